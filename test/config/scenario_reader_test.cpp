#include "brash_ice_rig/config/scenario_reader.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <locale>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "brash_ice_rig/config/yaml_document.h"
#include "config_files.h"
#include "key_lister.h"

namespace brash_ice_rig {
namespace {

std::string exactText(double value) {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out.precision(17);
  out << value;
  return out.str();
}

const std::string& pullUp() {
  static const std::string path = sourceFile("config/scenarios/pull_up.yaml");
  return path;
}

Scenario fromText(const std::string& yaml) {
  return loadScenario({writeFile("scenario.yaml", yaml), {}, {}});
}

/// Reads a scenario from text and gives the refusal without the file's path; line and rest are left.
std::string refusalOfText(const std::string& yaml) {
  const std::string path = writeFile("scenario.yaml", yaml);
  const std::string text = refusal({path, {}, {}});
  EXPECT_EQ(text.rfind(path + ":", 0), 0u) << text;
  return text.substr(std::min(path.size() + 1, text.size()));
}

std::string refusalOfSetting(const std::string& setting) {
  return refusal({pullUp(), {}, {setting}});
}

// ---- what is shipped

TEST(Settings, AKeyOfMillionsOfLettersIsRefusedWithoutBeingComparedLetterByLetter) {
  // Compared as a whole, these four would keep a node from its work for half a minute.
  for (int i = 0; i < 4; ++i) {
    EXPECT_THROW(loadScenario({"", {}, {std::string(4000000, 'k') + "=1"}}), ConfigError);
  }
}

TEST(ShippedScenarios, EachLoads) {
  const auto files = shippedFiles("config/scenarios");
  ASSERT_GE(files.size(), 2u);
  for (const std::string& file : files) {
    SCOPED_TRACE(file);
    EXPECT_NO_THROW(loadScenario({file, {}, {}}));
  }
}

TEST(ShippedSimulations, EachLoadsOverThePullUp) {
  const auto files = shippedFiles("config/simulations");
  ASSERT_EQ(files.size(), 10u) << "the paper has ten simulations";
  std::set<std::string> titles;
  for (const std::string& file : files) {
    SCOPED_TRACE(file);
    Scenario scenario;
    ASSERT_NO_THROW(scenario = loadScenario({pullUp(), {file}, {}}));
    titles.insert(scenario.title);
  }
  EXPECT_EQ(titles.size(), files.size());
}

TEST(ShippedIceSets, RecommendedIsTheDefaultAndPaperLiteralHasNoGapMemory) {
  ASSERT_EQ(shippedFiles("config/ice").size(), 2u);
  const KeyLister plain{loadScenario({pullUp(), {}, {}})};
  const KeyLister recommended{loadScenario({pullUp(), {sourceFile("config/ice/recommended.yaml")}, {}})};
  EXPECT_EQ(recommended.values, plain.values);
  KeyLister literal{loadScenario({pullUp(), {sourceFile("config/ice/paper_literal.yaml")}, {}})};
  EXPECT_EQ(literal.values.at("ice.model"), "paper_literal");
  EXPECT_EQ(literal.values.at("ice.gap_memory"), "false");
  EXPECT_EQ(literal.values.at("ice.damage"), "true");
  literal.values["ice.model"] = plain.values.at("ice.model");
  literal.values["ice.gap_memory"] = plain.values.at("ice.gap_memory");
  EXPECT_EQ(literal.values, plain.values);
}

TEST(ShippedIceSets, LieOverEachSimulation) {
  for (const std::string& simulation : shippedFiles("config/simulations")) {
    for (const std::string& set : shippedFiles("config/ice")) {
      EXPECT_NO_THROW(loadScenario({pullUp(), {simulation, set}, {}})) << simulation << ", " << set;
    }
  }
}

TEST(ShippedScenarios, PullUpGivesEachKeyOfTheBaselineAndTheDefaultsAreItsValues) {
  const std::string path = pullUp();
  const YAML::Node file = YAML::LoadFile(path);
  KeyLister defaults{Scenario{}};
  const KeyLister loaded{loadScenario({path, {}, {}})};
  defaults.values["title"] = loaded.values.at("title");
  EXPECT_EQ(loaded.values, defaults.values);

  const std::set<std::string> left_to_eq_10 = {"ice.shear_constant_pa", "ice.shear_slope"};
  for (const auto& [key, value] : defaults.values) {
    // What the baseline lacks is off, and not the subject of this file.
    const bool left_out = left_to_eq_10.count(key) == 1 || key.rfind("effects.", 0) == 0;
    EXPECT_NE(valueAt(file, key).IsDefined(), left_out) << key;
  }
}

TEST(ShippedScenarios, FullProcedureStartsAboveTheIceAndEndsWithTheRimAboveIt) {
  const Scenario scenario = loadScenario({sourceFile("config/scenarios/full_procedure.yaml"), {}, {}});
  EXPECT_EQ(scenario.procedure.start, StartPose::kFoldedAboveIce);
  const double ice_top = scenario.field.thickness_m - iceDraft(scenario);
  EXPECT_GT(startHubHeight(scenario), ice_top);
  EXPECT_GT(liftEndHubHeight(scenario), ice_top);
}

// ---- ranges, for each numeric key that there is

TEST(EachNumericKey, RefusesWhatIsOutOfRangeOrNoNumber) {
  const KeyLister keys{Scenario{}};
  ASSERT_GT(keys.numbers.size(), 50u);
  for (const KeyLister::Number& number : keys.numbers) {
    SCOPED_TRACE(number.key);
    const double width = number.range.max - number.range.min;
    const double below = number.whole ? number.range.min - 1.0 : number.range.min - 1.0e-3 * width;
    const double above = number.whole ? number.range.max + 2.0 : number.range.max + 1.0e-3 * width;
    std::vector<std::pair<std::string, std::string>> bad = {
        {exactText(below), "must lie in"},    {exactText(above), "must lie in"},   {".nan", "must be a finite number"},
        {"nan", "must be a finite number"},   {".inf", "must be a finite number"}, {"-inf", "must be a finite number"},
        {"1e999", "must be a finite number"}, {"much", "must be a number"},        {"1.0abc", "must be a number"},
        {"1,5", "must be a number"},          {"0x10", "must be a number"},        {"\"\"", "must be a number"}};
    if (number.range.min_open) bad.emplace_back(exactText(number.range.min), "must lie in");
    if (number.range.max_open) bad.emplace_back(exactText(number.range.max), "must lie in");
    if (number.whole) bad.emplace_back("1.5", "must be a whole number");

    const auto dot = number.key.find('.');
    for (const auto& [text, rule] : bad) {
      const std::string line = "  " + number.key.substr(dot + 1) + ": " + text + "\n";
      const std::string message = refusalOfText(number.key.substr(0, dot) + ":\n" + line);
      EXPECT_EQ(message.rfind("2: " + number.key + " = " + text + ", " + rule, 0), 0u) << message;
    }
  }
}

TEST(EachNumericKey, TakesItsBoundsUnlessTheyAreOpen) {
  // A value inside the range may still break a rule that ties keys together; that is told by another text.
  for (const KeyLister::Number& number : KeyLister{Scenario{}}.numbers) {
    SCOPED_TRACE(number.key);
    std::vector<double> bounds;
    if (!number.range.min_open) bounds.push_back(number.range.min);
    if (!number.range.max_open) bounds.push_back(number.range.max);
    for (const double bound : bounds) {
      std::string message;
      try {
        loadScenario({pullUp(),
                      {},
                      {number.key + "=" + (number.whole ? std::to_string(std::llround(bound)) : exactText(bound))}});
      } catch (const ConfigError& error) {
        message = error.what();
      }
      EXPECT_EQ(message.find("must lie in"), std::string::npos) << message;
    }
  }
}

TEST(EachKey, RefusesListMapAndNothing) {
  for (const auto& [key, value] : KeyLister{Scenario{}}.values) {
    SCOPED_TRACE(key);
    const auto dot = key.find('.');
    const std::string head = dot == std::string::npos ? key : key.substr(0, dot) + ":\n  " + key.substr(dot + 1);
    const std::string line = dot == std::string::npos ? "1: " : "2: ";
    EXPECT_EQ(refusalOfText(head + ": [1, 2]\n").rfind(line + key + " = [...], must be ", 0), 0u);
    EXPECT_EQ(refusalOfText(head + ": {}\n").rfind(line + key + " = {...}, must be ", 0), 0u);
    EXPECT_EQ(refusalOfText(head + ":\n").rfind(line + key + " has no value, must be ", 0), 0u);
    EXPECT_EQ(refusalOfText(head + ": ~\n").rfind(line + key + " has no value, must be ", 0), 0u);
  }
}

TEST(EachKey, WithWordsOrSwitchRefusesOtherWords) {
  const KeyLister keys{Scenario{}};
  ASSERT_FALSE(keys.words.empty());
  ASSERT_FALSE(keys.switches.empty());
  for (const auto& [key, allowed] : keys.words) {
    EXPECT_EQ(refusalOfSetting(key + "=None").rfind("--set: " + key + " = None, must be ", 0), 0u) << key;
  }
  for (const std::string& key : keys.switches) {
    EXPECT_EQ(refusalOfSetting(key + "=1"), "--set: " + key + " = 1, must be true or false");
  }
}

// ---- messages

TEST(ScenarioReader, NamesFileLineKeyValueAndRule) {
  EXPECT_EQ(refusalOfText("# comment\nice:\n  void_fraction: 1.2\n"), "3: ice.void_fraction = 1.2, must lie in (0, 1)");
  EXPECT_EQ(refusalOfText("solver: {threads: 1.5}"), "1: solver.threads = 1.5, must be a whole number");
  EXPECT_EQ(refusalOfText("collector:\n  fault: stuck\n"), "2: collector.fault = stuck, must be none, jam or no_lock");
}

TEST(ScenarioReader, CarriesThePartsOfTheError) {
  try {
    loadScenario({pullUp(), {}, {"ice.void_fraction=1.2"}});
    FAIL() << "accepted";
  } catch (const ConfigError& error) {
    EXPECT_EQ(error.key(), "ice.void_fraction");
    EXPECT_EQ(error.value(), "1.2");
    EXPECT_EQ(error.rule(), "must lie in (0, 1)");
    EXPECT_EQ(error.where(), "--set");
  }
}

TEST(ScenarioReader, UnknownKeyNamesTheNearestKnownOne) {
  EXPECT_EQ(refusalOfText("field:\n  spaceing_m: 0.3\n"),
            "2: unknown key field.spaceing_m; did you mean field.spacing_m?");
  EXPECT_EQ(refusalOfText("feild:\n  spacing_m: 0.3\n"),
            "2: unknown key feild.spacing_m; did you mean field.spacing_m?");
  EXPECT_EQ(refusalOfText("spacing_m: 0.3\n"), "1: unknown key spacing_m; did you mean field.spacing_m?");
  EXPECT_EQ(refusalOfText("spaceing_m: 0.3\n"), "1: unknown key spaceing_m; did you mean field.spacing_m?");
  EXPECT_EQ(refusalOfText("ice: {radius_m: 1}\n"), "1: unknown key ice.radius_m; did you mean collector.radius_m?");
  EXPECT_EQ(refusalOfText("ice: {cohesion: 200}\n"), "1: unknown key ice.cohesion; did you mean ice.cohesion_pa?");
  EXPECT_EQ(refusalOfText("colector:\n"), "1: unknown key colector; did you mean collector?");
  EXPECT_EQ(refusalOfText("ice: {void_fraction: {mean: 0.6}}\n"),
            "1: unknown key ice.void_fraction.mean; did you mean ice.void_fraction?");
  EXPECT_EQ(refusalOfSetting("ice.void_frction=0.5"),
            "--set: unknown key ice.void_frction; did you mean ice.void_fraction?");
}

TEST(ScenarioReader, KeyGivenTwiceIsRefused) {
  EXPECT_EQ(refusalOfText("field:\n  seed: 1\n  seed: 1\n"), "3: field.seed is given twice, first in line 2");
  EXPECT_EQ(refusalOfText("field: {seed: 1}\nice: {}\nfield: {spacing_m: 0.3}\n"),
            "3: field is given twice, first in line 1");
}

TEST(ScenarioReader, SectionMustBeAMapAndMayBeEmpty) {
  EXPECT_EQ(refusalOfText("field: 3\n"), "1: field = 3, must be a section with keys of its own");
  EXPECT_EQ(refusalOfText("field: [3]\n"), "1: field = [...], must be a section with keys of its own");
  EXPECT_EQ(refusalOfSetting("field=3"), "--set: field = 3, must be a section with keys of its own");
  EXPECT_NO_THROW(fromText("field:\nice: {}\n"));
}

TEST(ScenarioReader, UnreadableFileIsRefused) {
  EXPECT_EQ(refusal({"no/such/file.yaml", {}, {}}),
            "no/such/file.yaml: file cannot be read: No such file or directory");
  EXPECT_EQ(refusal({pullUp(), {"no/such/overlay.yaml"}, {}}),
            "no/such/overlay.yaml: file cannot be read: No such file or directory");
  EXPECT_EQ(refusal({::testing::TempDir(), {}, {}}), ::testing::TempDir() + ": is a directory, not a file");
}

TEST(ScenarioReader, FileThatWouldKeepItsReaderWaitingIsRefused) {
  const std::string pipe = ::testing::TempDir() + "scenario_reader_pipe";
  unlink(pipe.c_str());
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(refusal({pipe, {}, {}}), pipe + ": is not a regular file");
  EXPECT_EQ(refusal({pullUp(), {pipe}, {}}), pipe + ": is not a regular file");
  EXPECT_EQ(refusal({"/dev/zero", {}, {}}), "/dev/zero: is not a regular file");
  // A regular file to the system, in which the reader waits for the kernel's next message, if it may read it at all.
  EXPECT_NE(refusal({"/proc/kmsg", {}, {}}), "");
  unlink(pipe.c_str());
}

TEST(ScenarioReader, EmptyFileIsRefused) {
  for (const char* content : {"", "\n\n", "# only a comment\n"}) {
    EXPECT_EQ(refusalOfText(content), " file is empty") << content;
    EXPECT_NE(refusal({pullUp(), {writeFile("overlay.yaml", content)}, {}}).find("file is empty"), std::string::npos);
  }
}

TEST(ScenarioReader, SyntaxErrorNamesItsLine) {
  EXPECT_EQ(refusalOfText("field:\n  seed: 1\n  spacing_m: [0.3\nice: {}\n").rfind("4: not valid YAML: ", 0), 0u);
  EXPECT_EQ(refusalOfText("field:\n\tseed: 1\n").rfind("2: not valid YAML: ", 0), 0u);
  EXPECT_EQ(refusalOfText("field: *nowhere\n").rfind("1: not valid YAML: ", 0), 0u);
}

TEST(ScenarioReader, NoFileMeansTheDefaults) {
  EXPECT_EQ(toYaml(loadScenario({"", {}, {}})), toYaml(Scenario()));
  EXPECT_EQ(loadScenario({"", {}, {"field.thickness_m=1.0"}}).field.thickness_m, 1.0);
}

TEST(ScenarioReader, FileTooLargeForYamlIsRefusedUnread) {
  const std::string path = writeFile("large.yaml", "title: x\n" + std::string(kMaxYamlBytes, '#'));
  EXPECT_EQ(refusal({path, {}, {}}), path + ": is larger than 4 MB, which no YAML file of ours is");
}

TEST(ScenarioReader, FileMustBeOneMap) {
  const std::string rule = " must be a map of sections, such as `field:` with indented `spacing_m: 0.3`";
  for (const char* content : {"- 1\n- 2\n", "just words\n", "---\n", "~\n", ",a\n"}) {
    EXPECT_EQ(refusalOfText(content), rule) << content;
  }
  EXPECT_EQ(refusalOfText("title: one\n---\ntitle: two\n"), " must hold a single YAML document");
  EXPECT_EQ(refusalOfText("? [a, b]\n: 1\n"), "1: each key must be a single word");
}

TEST(ScenarioReader, AliasThatHoldsItselfIsRefused) {
  EXPECT_NE(refusalOfText("field: &f\n  seed: 1\n  more: *f\n").find("unknown key field.more"), std::string::npos);
}

TEST(ScenarioReader, MalformedSettingIsRefused) {
  EXPECT_EQ(refusalOfSetting("ice.void_fraction"), "--set: `ice.void_fraction` must read section.key=value");
  EXPECT_EQ(refusalOfSetting("=0.5"), "--set: `=0.5` must read section.key=value");
  EXPECT_EQ(refusalOfSetting(""), "--set: `` must read section.key=value");
  EXPECT_EQ(refusalOfSetting("ice.void_fraction="), "--set: ice.void_fraction = \"\", must be a number");
}

// ---- composition

TEST(ScenarioReader, LaterSourcesWin) {
  const std::string file =
      writeFile("file.yaml", "ice: {void_fraction: 0.5}\nfield: {seed: 2}\nwater: {density_kgpm3: 1010}\n");
  const std::string overlay = writeFile("overlay.yaml", "ice: {void_fraction: 0.4}\nfield: {seed: 3}\n");
  const Scenario scenario = loadScenario({file, {overlay}, {"field.seed=4", "field.seed=5", "title=a = b: c"}});
  EXPECT_EQ(scenario.water.density_kgpm3, 1010.0);
  EXPECT_EQ(scenario.ice.void_fraction, 0.4);
  EXPECT_EQ(scenario.field.seed, 5u);
  EXPECT_EQ(scenario.title, "a = b: c");
  EXPECT_EQ(scenario.collector.radius_m, CollectorConfig().radius_m);
}

TEST(ScenarioReader, OverlaysThatContradictEachOtherAreRefused) {
  const std::string first = writeFile("first.yaml", "ice:\n  void_fraction: 0.5\n");
  const std::string second = writeFile("second.yaml", "ice:\n  poisson_ratio: 0.2\n  void_fraction: 0.55\n");
  EXPECT_EQ(refusal({pullUp(), {first, second}, {}}),
            second + ":3: ice.void_fraction = 0.55, contradicts the overlay " + first + ":2, which gives 0.5");
}

TEST(ScenarioReader, OverlaysThatAgreeAreTaken) {
  const std::string first = writeFile("first.yaml", "ice: {void_fraction: 0.5}\n");
  const std::string second = writeFile("second.yaml", "ice: {void_fraction: 5.0e-1, poisson_ratio: 0.2}\n");
  const Scenario scenario = loadScenario({pullUp(), {first, second}, {}});
  EXPECT_EQ(scenario.ice.void_fraction, 0.5);
  EXPECT_EQ(scenario.ice.poisson_ratio, 0.2);
}

TEST(ScenarioReader, OverrideWithoutEffectIsRefused) {
  const std::string fixed = writeFile("fixed.yaml", "ice:\n  shear_constant_pa: 200.0\n");
  const std::string sloped = writeFile("sloped.yaml", "ice:\n  shear_slope: 0.4\n");
  EXPECT_EQ(refusal({fixed, {}, {"ice.cohesion_pa=1000"}}),
            "--set: ice.cohesion_pa = 1000, has no effect on ice.shear_constant_pa, which " + fixed +
                ":2 fixes; set that key too, or leave it out there so that eq. 10 gives it");
  EXPECT_NE(refusal({fixed, {}, {"ice.friction_angle_deg=45"}}).find("no effect on ice.shear_constant_pa"),
            std::string::npos);
  EXPECT_NE(refusal({sloped, {}, {"ice.friction_angle_deg=45"}}).find("no effect on ice.shear_slope"),
            std::string::npos);
  EXPECT_NO_THROW(loadScenario({sloped, {}, {"ice.cohesion_pa=1000"}}));
  EXPECT_NO_THROW(loadScenario({pullUp(), {}, {"ice.cohesion_pa=1000"}}));
  EXPECT_NO_THROW(loadScenario({fixed, {}, {"ice.cohesion_pa=1000", "ice.shear_constant_pa=900"}}));
  EXPECT_NO_THROW(loadScenario({fixed, {}, {"ice.shear_constant_pa=900", "ice.cohesion_pa=1000"}}));
}

TEST(ScenarioReader, RuleBetweenKeysNamesTheLineOfItsKey) {
  EXPECT_EQ(refusalOfText("collector:\n  radius_m: 9.0\n").rfind("2: collector.radius_m = 9, must be at most 6.9", 0),
            0u);
  // The key at fault is a default here; the file is all that can be named.
  EXPECT_EQ(refusalOfText("field: {length_x_m: 3.0}\n").rfind(" collector.radius_m = 1.3, must be at most 0.9", 0), 0u);
}

TEST(ScenarioReader, ReadsTheSameInAnyLocale) {
  class CommaDecimals : public std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new CommaDecimals));
  const Scenario scenario = loadScenario({pullUp(), {}, {"ice.void_fraction=0.45"}});
  const std::string yaml = toYaml(scenario);
  std::locale::global(before);
  EXPECT_EQ(scenario.ice.void_fraction, 0.45);
  EXPECT_NE(yaml.find("  void_fraction: 0.45  #"), std::string::npos);
  EXPECT_NE(yaml.find("  min_stiffness_npm: 50000  #"), std::string::npos);
}

// ---- writing

TEST(EffectiveScenario, ReadsBackToTheSameBits) {
  Scenario scenario;
  scenario.title = "quotes \" ' and : # \\ { [ \n\t\xC3\xA5";
  scenario.field.spacing_m = 0.1 + 0.2;
  scenario.field.seed = 9007199254740991u;
  scenario.field.jitter_ratio = 1.0e-300;
  scenario.ice.void_fraction = 1.0 / 3.0;
  scenario.ice.shear_constant_pa = 123.456789012345678;
  scenario.ice.flow_rule = FlowRule::kNonAssociated;
  scenario.ice.three_invariant = true;
  scenario.collector.fault = FoldFault::kNoLock;
  scenario.contact.min_stiffness_npm = 1.0e12;
  scenario.load_cell.bias_n = -1.0 / 7.0;
  scenario.procedure.control = ControlMode::kManual;
  scenario.solver.threads = 7;
  for (const Scenario& original : {Scenario{}, scenario}) {
    const Scenario copy = fromText(toYaml(original));
    EXPECT_EQ(KeyLister{copy}.values, KeyLister{original}.values);
    EXPECT_EQ(copy.field.seed, original.field.seed);
  }
}

TEST(EffectiveScenario, WritesSectionsWithinSections) {
  const std::string yaml = toYaml(Scenario{});
  EXPECT_NE(yaml.find("\neffects:\n  porosity_gradient:\n    enabled: false  # "), std::string::npos) << yaml;
  EXPECT_NE(yaml.find("\n  load_cell_bias:\n    enabled: false"), std::string::npos);
  EXPECT_EQ(yaml.find("effects:", yaml.find("effects:") + 1), std::string::npos) << "one section for all";
}

TEST(EffectiveScenario, ExplainsEachKey) {
  const std::string yaml = toYaml(Scenario{});
  EXPECT_NE(yaml.find("  void_fraction: 0.6  # share of the volume that is not ice, V_f; (0, 1)\n"), std::string::npos);
  EXPECT_NE(yaml.find("  # shear_slope is not set: theta of the shear surface;"), std::string::npos);
  EXPECT_NE(yaml.find("  fault: none  # trouble of the folding mechanism; none, jam or no_lock\n"), std::string::npos);
  std::istringstream lines(yaml);
  std::size_t explained = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.find(": ") != std::string::npos && line.find("# ") != std::string::npos && line[0] != '#') ++explained;
  }
  EXPECT_EQ(explained, KeyLister{Scenario{}}.values.size());
}

TEST(EffectiveScenario, NumbersAreNumbersForYaml11ReadersToo) {
  // YAML 1.1, as Python's reader has it, wants a point and a signed exponent: 1e6 would be text.
  const std::regex number("[-+]?([0-9]+|[0-9]+\\.[0-9]*([eE][-+][0-9]+)?)");
  Scenario scenario;
  scenario.contact.min_stiffness_npm = 1.0e12;
  scenario.ice.cap_hardening_linear_per_pa = 1.0e-4;
  const YAML::Node yaml = YAML::Load(toYaml(scenario));
  for (const KeyLister::Number& key : KeyLister{scenario}.numbers) {
    const YAML::Node value = valueAt(yaml, key.key);
    if (!value.IsDefined()) continue;  // optional and not set
    EXPECT_TRUE(std::regex_match(value.Scalar(), number)) << key.key << ": " << value.Scalar();
  }
}

// ---- values one by one

TEST(KeyValues, ListEveryKeyOnceWithItsValueWithoutQuotes) {
  Scenario scenario;
  scenario.title = "With \"quotes\", and: more";
  scenario.ice.cohesion_pa = 1.0 / 3.0;
  scenario.ice.three_invariant = true;
  scenario.ice.flow_rule = FlowRule::kNonAssociated;
  std::set<std::string> names;
  std::map<std::string, std::string> value_of;
  for (const auto& [key, value] : keyValues(scenario)) {
    EXPECT_TRUE(names.insert(key).second) << key;
    value_of[key] = value;
  }
  EXPECT_EQ(names.size(), KeyLister(scenario).values.size());
  EXPECT_EQ(value_of["title"], scenario.title);
  EXPECT_EQ(std::stod(value_of["ice.cohesion_pa"]), 1.0 / 3.0);
  EXPECT_EQ(value_of["ice.three_invariant"], "true");
  EXPECT_EQ(value_of["ice.flow_rule"], "non_associated");
  EXPECT_EQ(value_of["ice.shear_constant_pa"], "") << "not set";
}

}  // namespace
}  // namespace brash_ice_rig
