#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <ostream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "../config/config_files.h"
#include "../config/key_lister.h"
#include "brash_ice_rig/ice/ice_scaling.h"

// Tables 4 to 7 of the paper, cell by cell: the print is the outside number, our formulas compute it again.
// doc/paper_tables.md shows the same to readers.

namespace brash_ice_rig {
namespace {

/// Of the parent ice in compression, J/m²; see the misprint of Table 4.
constexpr double kParentFractureEnergy = 20.0;
constexpr double kJoulePerM2InMpaMm = 1.0e-3;

struct Cell {
  int table;
  std::string symbol;              ///< in the names of tests
  std::string quantity;            ///< in the document, with the paper's unit
  std::string column;              ///< of simulations, as printed
  std::string printed;             ///< as printed
  std::string key;                 ///< of a scenario; empty: none
  double unit_si;                  ///< one of the paper's units in the key's
  std::string formula;             ///< "given": an input
  std::optional<double> computed;  ///< in the paper's unit

  double value() const { return std::strtod(printed.c_str(), nullptr); }

  /// Half a unit of the last printed digit: what rounding may hide.
  double tolerance() const {
    const auto end = printed.find('E');
    const auto point = printed.find('.');
    const auto decimals = point == std::string::npos ? 0 : static_cast<int>(printed.substr(0, end).size() - point - 1);
    const int exponent = end == std::string::npos ? 0 : std::stoi(printed.substr(end + 1));
    return 0.5 * std::pow(10.0, exponent - decimals);
  }
  bool agrees() const { return std::abs(*computed - value()) <= tolerance() * (1.0 + 1e-9); }

  std::vector<std::string> simulations() const {
    std::vector<std::string> names;
    std::istringstream in(column);
    for (std::string name; std::getline(in >> std::ws, name, ',');) names.push_back(name);
    return names;
  }
};

std::ostream& operator<<(std::ostream& out, const Cell& cell) {
  return out << "Table " << cell.table << " " << cell.symbol << " of " << cell.simulations().front();
}

/// Cells that our formulas contradict, each with the reason why it is the print that errs.
struct Misprint {
  int table;
  std::string symbol, column, printed, computed, reason;
};

const std::vector<Misprint>& misprints() {
  static const std::vector<Misprint> list = {
      {4, "G_fc", "level ice", "2.0E-05", "2.000E-02",
       "Table 7 needs 2.0E-02 in each of its columns; 2.0E-05 is the same energy, 20 J/m², in MPa m"},
      {6, "alpha", "A-2, B-2", "1.0E-04", "4.984E-05",
       "c is a quarter of B-1's, and so is α; R times 4.984E-05 is the printed X0, R times 1.0E-04 is twice as much"},
      {6, "alpha", "B-4", "2.0E-04", "2.252E-04",
       "B-1's α, but φ is 40°; R times 2.252E-04 rounds to the printed X0, R times 2.0E-04 does not"},
      {6, "alpha", "B-5", "2.0E-04", "1.623E-04", "B-1's α, but φ is 60°"},
      {6, "X0", "B-5", "0.004", "1.454E-03",
       "the column mixes others: R of 50°, X0 of B-4, D1 of A-2 and B-2, and no two of the three fit each other"},
  };
  return list;
}

const Misprint* misprintOf(const Cell& cell) {
  for (const Misprint& m : misprints()) {
    if (m.table == cell.table && m.symbol == cell.symbol && m.column == cell.column) return &m;
  }
  return nullptr;
}

std::string formatted(const char* format, double value) {
  char text[40];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

std::string computedText(const Cell& cell) {
  return formatted("%.3E", *cell.computed);
}

// ---- the print

const std::vector<std::string>& simulationNames() {
  static const std::vector<std::string> names = {"A-1", "A-2", "A-3", "B-1", "B-2", "B-3", "B-4", "B-5", "C-1", "D-1"};
  return names;
}

struct Inputs {
  std::string void_percent, cohesion_kpa, friction_angle_deg;
  double voidFraction() const { return std::stod(void_percent) / 100.0; }
  ShearSurface shearSurface() const {
    return computeShearSurface(std::stod(cohesion_kpa) * 1.0e3, std::stod(friction_angle_deg));
  }
};

/// Table 5.
const std::map<std::string, Inputs>& inputs() {
  static const std::map<std::string, Inputs> table = {
      {"A-1", {"70", "0.2", "50"}}, {"A-2", {"70", "0.05", "50"}}, {"A-3", {"70", "1", "50"}},
      {"B-1", {"60", "0.2", "50"}}, {"B-2", {"60", "0.05", "50"}}, {"B-3", {"60", "1", "50"}},
      {"B-4", {"60", "0.2", "40"}}, {"B-5", {"60", "0.2", "60"}},  {"C-1", {"50", "0.2", "50"}},
      {"D-1", {"36", "0.2", "50"}},
  };
  return table;
}

/// A column of Table 6.
struct CapColumn {
  std::string simulations, alpha, theta, r, x0, w, d1, d2;
  const Inputs& input() const { return inputs().at(simulations.substr(0, 3)); }
};

const std::vector<CapColumn>& capColumns() {
  static const std::vector<CapColumn> columns = {
      {"A-1, B-1, C-1, D-1", "2.0E-04", "0.396", "8.957", "0.002", "0.093", "86", "0.030"},
      {"A-2, B-2", "1.0E-04", "0.396", "8.957", "4.5E-04", "0.093", "386", "0.030"},
      {"A-3, B-3", "1.0E-03", "0.396", "8.957", "0.009", "0.093", "23", "0.030"},
      {"B-4", "2.0E-04", "0.315", "17.205", "0.004", "0.093", "43", "0.030"},
      {"B-5", "2.0E-04", "0.469", "8.957", "0.004", "0.093", "386", "0.030"},
  };
  return columns;
}

/// A column of Table 7.
struct DamageColumn {
  std::string simulations, compression, tension, shear;
};

const std::vector<DamageColumn>& damageColumns() {
  static const std::vector<DamageColumn> columns = {
      {"A-1, A-2, A-3", "3.27E-03", "3.72E-04", "3.72E-04"},
      {"B-1, B-2, B-3, B-4, B-5", "4.51E-03", "5.13E-04", "5.13E-04"},
      {"C-1", "5.86E-03", "6.66E-04", "6.66E-04"},
      {"D-1", "8.00E-03", "9.10E-04", "9.10E-04"},
  };
  return columns;
}

// ---- print and formula, cell by cell

std::vector<Cell> table4() {
  // The energy that column D-1 of Table 7 comes from: eq. 13 backwards.
  const double parent_energy = std::stod(damageColumns().back().compression) / (1.0 - std::sqrt(0.36));
  const std::string ice = "level ice";
  return {
      {4, "nu", "ν [–]", ice, "0.3", "ice.poisson_ratio", 1.0, "given", {}},
      {4, "rho", "ρ_ice [kg/m³]", ice, "900", "ice.parent_density_kgpm3", 1.0, "given", {}},
      {4, "E", "E_ice [MPa]", ice, "4000", "ice.parent_elastic_modulus_pa", 1.0e6, "given", {}},
      {4, "K_I", "K_I [kPa √m]", ice, "100", "ice.parent_fracture_toughness_pa_sqrt_m", 1.0e3, "given", {}},
      {4, "G_fc", "G_f^C [MPa mm]", ice, "2.0E-05", "", 1.0e3, "eq. 13 and Table 7", parent_energy},
  };
}

std::vector<Cell> table5() {
  std::vector<Cell> cells;
  for (const std::string& name : simulationNames()) {
    const Inputs& in = inputs().at(name);
    cells.push_back({5, "V_f", "V_f [%]", name, in.void_percent, "ice.void_fraction", 0.01, "given", {}});
    cells.push_back({5, "c", "c [kPa]", name, in.cohesion_kpa, "ice.cohesion_pa", 1.0e3, "given", {}});
    cells.push_back({5, "phi", "φ [°]", name, in.friction_angle_deg, "ice.friction_angle_deg", 1.0, "given", {}});
  }
  return cells;
}

std::vector<Cell> table6() {
  std::vector<Cell> cells;
  for (const CapColumn& column : capColumns()) {
    const std::string& sims = column.simulations;
    const ShearSurface surface = column.input().shearSurface();
    const double alpha = surface.constant_pa / 1.0e6, x0 = std::stod(column.r) * alpha;
    cells.push_back({6, "alpha", "α [MPa]", sims, column.alpha, "ice.shear_constant_pa", 1.0e6, "eq. 10", alpha});
    cells.push_back({6, "theta", "θ [–]", sims, column.theta, "ice.shear_slope", 1.0, "eq. 10", surface.slope});
    cells.push_back({6, "R", "R [–]", sims, column.r, "ice.cap_aspect_ratio", 1.0, "given", {}});
    cells.push_back({6, "X0", "X0 [MPa]", sims, column.x0, "ice.cap_initial_intercept_pa", 1.0e6, "R α", x0});
    cells.push_back({6, "W", "W [–]", sims, column.w, "ice.cap_max_compaction", 1.0, "given", {}});
    cells.push_back({6, "D1", "D1 [1/MPa]", sims, column.d1, "ice.cap_hardening_linear_per_pa", 1.0e-6, "given", {}});
    cells.push_back(
        {6, "D2", "D2 [1/MPa²]", sims, column.d2, "ice.cap_hardening_quadratic_per_pa2", 1.0e-12, "given", {}});
  }
  return cells;
}

std::vector<Cell> table7() {
  std::vector<Cell> cells;
  for (const DamageColumn& column : damageColumns()) {
    const std::string& sims = column.simulations;
    const double void_fraction = inputs().at(sims.substr(0, 3)).voidFraction();
    const double compression = computeCompressiveFractureEnergy(kParentFractureEnergy, void_fraction);
    const double tension =
        computeTensileFractureEnergy(computeFractureToughness(100.0e3, void_fraction),
                                     computeBrashElasticModulus(4000.0e6, void_fraction), 0.3);  // Table 4
    const double unit = 1.0 / kJoulePerM2InMpaMm;
    cells.push_back({7, "B", "B [–]", sims, "1", "ice.damage_ductile_shape", 1.0, "given", {}});
    cells.push_back({7, "G_fc", "G_fc [MPa mm]", sims, column.compression, "", unit, "eq. 13", compression / unit});
    cells.push_back({7, "D", "D [–]", sims, "1", "ice.damage_brittle_shape", 1.0, "given", {}});
    cells.push_back({7, "G_ft", "G_ft [MPa mm]", sims, column.tension, "", unit, "eqs. 14, 15", tension / unit});
    cells.push_back({7, "G_fs", "G_fs [MPa mm]", sims, column.shear, "", unit, "eqs. 14, 15", tension / unit});
  }
  return cells;
}

std::vector<Cell> allCells() {
  std::vector<Cell> cells;
  for (const auto& table : {table4(), table5(), table6(), table7()})
    cells.insert(cells.end(), table.begin(), table.end());
  return cells;
}

std::vector<Cell> withFormula(std::vector<Cell> cells) {
  cells.erase(std::remove_if(cells.begin(), cells.end(), [](const Cell& c) { return !c.computed; }), cells.end());
  return cells;
}

std::vector<Cell> withKey(std::vector<Cell> cells) {
  cells.erase(std::remove_if(cells.begin(), cells.end(), [](const Cell& c) { return c.key.empty(); }), cells.end());
  return cells;
}

std::string testName(const ::testing::TestParamInfo<Cell>& info) {
  std::string name = info.param.symbol + "_" + info.param.simulations().front();
  name.erase(std::remove_if(name.begin(), name.end(), [](char c) { return c == '-' || c == ' '; }), name.end());
  return name;
}

// ---- each cell

class CellWithFormula : public ::testing::TestWithParam<Cell> {};

TEST_P(CellWithFormula, AgreesToTheLastPrintedDigitOrIsAListedMisprint) {
  const Cell& cell = GetParam();
  EXPECT_EQ(cell.agrees(), misprintOf(cell) == nullptr)
      << "printed " << cell.printed << " within " << cell.tolerance() << ", computed " << *cell.computed;
}

INSTANTIATE_TEST_SUITE_P(Table4, CellWithFormula, ::testing::ValuesIn(withFormula(table4())), testName);
INSTANTIATE_TEST_SUITE_P(Table6, CellWithFormula, ::testing::ValuesIn(withFormula(table6())), testName);
INSTANTIATE_TEST_SUITE_P(Table7, CellWithFormula, ::testing::ValuesIn(withFormula(table7())), testName);

/// As printed, misprints included: who runs a simulation of the paper gets the paper's numbers.
class CellWithKey : public ::testing::TestWithParam<Cell> {};

TEST_P(CellWithKey, IsHeldAsPrintedByTheFilesOfItsSimulations) {
  const Cell& cell = GetParam();
  for (const std::string& simulation : cell.table == 4 ? simulationNames() : cell.simulations()) {
    const std::string file = std::string(1, static_cast<char>(std::tolower(simulation[0]))) + simulation.substr(2);
    const Scenario scenario = loadScenario(
        {sourceFile("config/scenarios/pull_up.yaml"), {sourceFile("config/simulations/" + file + ".yaml")}, {}});
    const double held = std::strtod(KeyLister{scenario}.values.at(cell.key).c_str(), nullptr);
    EXPECT_DOUBLE_EQ(held, cell.value() * cell.unit_si) << simulation << ", " << cell.key;
  }
}

INSTANTIATE_TEST_SUITE_P(Table4, CellWithKey, ::testing::ValuesIn(withKey(table4())), testName);
INSTANTIATE_TEST_SUITE_P(Table5, CellWithKey, ::testing::ValuesIn(withKey(table5())), testName);
INSTANTIATE_TEST_SUITE_P(Table6, CellWithKey, ::testing::ValuesIn(withKey(table6())), testName);

TEST(PaperTables, AreComplete) {
  EXPECT_EQ(table4().size(), 5u);
  EXPECT_EQ(table5().size(), 3u * 10u);
  EXPECT_EQ(table6().size(), 7u * 5u);
  EXPECT_EQ(table7().size(), 5u * 4u);
  for (const auto& table : {table6(), table7()}) {
    std::set<std::string> named;
    for (const Cell& cell : table)
      for (const std::string& simulation : cell.simulations()) named.insert(simulation);
    EXPECT_EQ(named.size(), simulationNames().size());
  }
}

TEST(PaperTables, EachMisprintIsThatOfOneCell) {
  for (const Misprint& m : misprints()) {
    SCOPED_TRACE("Table " + std::to_string(m.table) + ", " + m.symbol + " of " + m.column);
    int found = 0;
    for (const Cell& cell : withFormula(allCells())) {
      if (misprintOf(cell) != &m) continue;
      ++found;
      EXPECT_EQ(cell.printed, m.printed);
      EXPECT_EQ(computedText(cell), m.computed);
    }
    EXPECT_EQ(found, 1);
  }
}

TEST(PaperTables, SimulationsOfOneColumnShareItsInputs) {
  for (const CapColumn& column : capColumns()) {
    for (const std::string& simulation : Cell{6, "", "", column.simulations, "", "", 1.0, "", {}}.simulations()) {
      EXPECT_EQ(inputs().at(simulation).cohesion_kpa, column.input().cohesion_kpa) << simulation;
      EXPECT_EQ(inputs().at(simulation).friction_angle_deg, column.input().friction_angle_deg) << simulation;
    }
  }
  for (const DamageColumn& column : damageColumns()) {
    for (const std::string& simulation : Cell{7, "", "", column.simulations, "", "", 1.0, "", {}}.simulations()) {
      EXPECT_EQ(inputs().at(simulation).void_percent, inputs().at(column.simulations.substr(0, 3)).void_percent);
    }
  }
}

// ---- what ties the given cells of Table 6 together, found, not printed

TEST(CapColumns, HaveOneAspectRatioPerFrictionAngleAndOneWAndD2) {
  std::map<std::string, std::string> ratio_of_angle;
  for (const CapColumn& column : capColumns()) {
    const std::string& known = ratio_of_angle.emplace(column.input().friction_angle_deg, column.r).first->second;
    EXPECT_EQ(column.r, known) << column.simulations;
    EXPECT_EQ(column.w, capColumns().front().w) << column.simulations;
    EXPECT_EQ(column.d2, capColumns().front().d2) << column.simulations;
  }
}

TEST(CapColumns, HardenOverTheirOwnInterceptInAllButB5) {
  for (const CapColumn& column : capColumns()) {
    const double product = std::stod(column.d1) * std::stod(column.x0);
    const bool regular = product >= 0.17 && product <= 0.21;
    EXPECT_EQ(regular, column.simulations != "B-5") << column.simulations << ": D1 X0 = " << product;
  }
}

// ---- the document

std::string guide() {
  std::ifstream in(sourceFile("doc/paper_tables.md"));
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

/// All of a row but the remark, which is a person's; a misprint's is the reason above.
std::string rowOf(const Cell& cell) {
  std::string row = "| " + std::to_string(cell.table) + " | " + cell.quantity + " | " + cell.column + " | " +
                    cell.printed + " | " + formatted("%.0E", cell.tolerance()) + " | ";
  row += cell.computed ? computedText(cell) + " | " +
                             formatted("%+.1f %%", 100.0 * (*cell.computed - cell.value()) / cell.value())
                       : std::string("– | –");
  row += " | " + cell.formula + " | ";
  if (const Misprint* misprint = misprintOf(cell)) row += "**Misprint**: " + misprint->reason + " |\n";
  return row;
}

TEST(PaperTablesGuide, ShowsEachCellAsItIsPrintedAndComputed) {
  const std::string text = guide();
  for (const Cell& cell : allCells()) {
    EXPECT_NE(text.find("\n" + rowOf(cell)), std::string::npos) << "no row that starts\n" << rowOf(cell);
  }
}

TEST(PaperTablesGuide, ShowsNoOtherCellsOrMisprints) {
  std::istringstream lines(guide());
  std::size_t rows = 0, marked = 0;
  for (std::string line; std::getline(lines, line);) {
    const bool row = line.size() > 4 && line.rfind("| ", 0) == 0 && line[2] >= '4' && line[2] <= '7' && line[3] == ' ';
    rows += row ? 1 : 0;
    marked += row && line.find("**Misprint**") != std::string::npos ? 1 : 0;
  }
  EXPECT_EQ(rows, allCells().size());
  EXPECT_EQ(marked, misprints().size());
}

TEST(PaperTablesGuide, ShowsWhatTiesTheCapColumnsTogether) {
  const std::string text = guide();
  for (const CapColumn& column : capColumns()) {
    const double r_alpha = std::stod(column.r) * column.input().shearSurface().constant_pa / 1.0e6;
    const double product = std::stod(column.d1) * std::stod(column.x0);
    const std::string row = "\n| " + column.simulations + " | " + column.input().friction_angle_deg + " | " + column.r +
                            " | " + formatted("%.2E", r_alpha) + " | " + column.x0 + " | " + column.d1 + " | " +
                            formatted("%.2f", product) + " |\n";
    EXPECT_NE(text.find(row), std::string::npos) << "no row" << row;
  }
}

}  // namespace
}  // namespace brash_ice_rig
