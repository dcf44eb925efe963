#include "brash_ice_rig/config/scenario.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <string>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/math/angle.h"
#include "brash_ice_rig/math/repeatable.h"
#include "brash_ice_rig/rig/crane_motion.h"
#include "brash_ice_rig/rig/rig_commands.h"
#include "brash_ice_rig/sph/kernel.h"
#include "brash_ice_rig/system/available_memory.h"

namespace brash_ice_rig {
namespace {

/// Absorbs round-off where lengths that were meant to be equal are compared, m.
constexpr double kLengthTolerance = 1.0e-9;

/// Checks the range of every number of the scenario.
class RangeChecker {
 public:
  template <class Number>
  void operator()(const char* name, const Number& value, const Range& range, const char*) {
    const auto number = static_cast<double>(value);
    checkRange(section_ + name, number, formatNumber(number), range);
  }
  void operator()(const char* name, const std::optional<double>& value, const Range& range, const char* text) {
    if (value) (*this)(name, *value, range, text);
  }
  template <class Word>
  void operator()(const char*, const Word&, std::initializer_list<const char*>, const char*) {}
  template <class Word>
  void operator()(const char*, const Word&, const char*) {}

  template <class Section>
  void section(const char* name, Section& section) {
    const std::string outer = section_;
    section_ += std::string(name) + ".";
    section.visit(*this);
    section_ = outer;
  }

 private:
  std::string section_;
};

void require(bool fulfilled, const char* key, double value, const std::string& rule) {
  if (!fulfilled) throw ConfigError(key, formatNumber(value), rule);
}

/// Three decimals at most, for derived figures in messages.
std::string rounded(double value) {
  return formatNumber(std::round(value * 1000.0) / 1000.0);
}

void checkField(const FieldConfig& field) {
  const double spacing = field.spacing_m;
  require(field.thickness_m >= spacing - kLengthTolerance, "field.thickness_m", field.thickness_m,
          "must be at least one field.spacing_m (" + formatNumber(spacing) + ")");
  // The outermost particles are fixed: with fewer than five there is hardly anything left to move.
  const std::string rule = "must be at least 5 times field.spacing_m (" + formatNumber(spacing) + ")";
  require(field.length_x_m >= 5.0 * spacing - kLengthTolerance, "field.length_x_m", field.length_x_m, rule);
  require(field.length_y_m >= 5.0 * spacing - kLengthTolerance, "field.length_y_m", field.length_y_m, rule);
}

void checkSize(const FieldConfig& field, const SolverConfig& solver) {
  const double count = particleCount(field);
  constexpr double kMaxCount = std::numeric_limits<int>::max();
  const std::string remedy = "; choose a larger spacing or a smaller field";
  const std::string particles = "makes " + rounded(count / 1.0e6) + " million particles";
  require(count <= kMaxCount, "field.spacing_m", field.spacing_m,
          particles + ", at most " + rounded(kMaxCount / 1.0e6) + " million can be numbered" + remedy);
  const double needed = count * bytesPerParticle(solver);
  const double available = availableMemory();
  require(needed <= available, "field.spacing_m", field.spacing_m,
          particles + ", which need about " + rounded(needed / 1.0e9) + " GB of memory, but only " +
              rounded(available / 1.0e9) + " GB are free" + remedy);
}

void checkFloats(const Scenario& scenario) {
  require(
      scenario.ice.parent_density_kgpm3 < scenario.water.density_kgpm3, "ice.parent_density_kgpm3",
      scenario.ice.parent_density_kgpm3,
      "must be less than water.density_kgpm3 (" + formatNumber(scenario.water.density_kgpm3) + "), or the ice sinks");
}

void checkCollector(const Scenario& scenario) {
  const CollectorConfig& collector = scenario.collector;
  const FieldConfig& field = scenario.field;
  const double half_side = 0.5 * std::min(field.length_x_m, field.length_y_m);
  const double largest_radius = half_side - 2.0 * field.spacing_m;
  require(collector.radius_m <= largest_radius + kLengthTolerance, "collector.radius_m", collector.radius_m,
          "must be at most " + rounded(largest_radius) + ": half of the field's shorter side (" +
              formatNumber(half_side) + ") less 2 times field.spacing_m");
  const double unfolded_deg = unfoldedArmAngle(collector) / kDegree;
  require(collector.folded_arm_angle_deg > unfolded_deg, "collector.folded_arm_angle_deg",
          collector.folded_arm_angle_deg,
          "must be greater than the unfolded arm's angle atan(rim_height_m / radius_m) = " + rounded(unfolded_deg));
  // The pole that stands in the ice from the start pushes the blocks in its way aside: one layer of them, not more.
  if (scenario.procedure.start == StartPose::kUnfoldedUnderIce) {
    require(collector.pole_radius_m <= field.spacing_m, "collector.pole_radius_m", collector.pole_radius_m,
            "must be at most field.spacing_m (" + formatNumber(field.spacing_m) +
                ") when the procedure starts under the ice");
  }
}

void checkContact(const ContactConfig& contact) {
  require(contact.friction_dynamic <= contact.friction_static, "contact.friction_dynamic", contact.friction_dynamic,
          "must be at most contact.friction_static (" + formatNumber(contact.friction_static) + ")");
}

/// The crane tip must be able to stand where the pole's upper end is while the hub is at this height.
void checkCraneHolds(const Scenario& scenario, double hub_height, const std::string& moment) {
  const CraneConfig& crane = scenario.crane;
  const double tip = hub_height + scenario.collector.pole_length_m;
  const std::string position = moment + " (hub at " + rounded(hub_height) + " m, pole of " +
                               formatNumber(scenario.collector.pole_length_m) + " m)";
  // Bounds are rounded outwards: the figure in the message must be good enough when it is typed in.
  require(tip <= crane.max_height_m + kLengthTolerance, "crane.max_height_m", crane.max_height_m,
          "must be at least " + formatNumber(std::ceil((tip - kLengthTolerance) * 1000.0) / 1000.0) +
              " to hold the rig " + position);
  require(tip >= crane.min_height_m - kLengthTolerance, "crane.min_height_m", crane.min_height_m,
          "must be at most " + formatNumber(std::floor((tip + kLengthTolerance) * 1000.0) / 1000.0) +
              " to hold the rig " + position);
}

void checkCraneSpeed(const CraneConfig& crane, const char* key, double speed) {
  require(speed <= crane.max_speed_mps, key, speed,
          "must be at most crane.max_speed_mps (" + formatNumber(crane.max_speed_mps) + ")");
}

void checkCraneMotion(const Scenario& scenario) {
  const std::string& file = scenario.procedure.motion_file;
  const CraneMotion motion = CraneMotion::read(file);
  if (motion.fastest() > scenario.crane.max_speed_mps) {
    throw ConfigError("procedure.motion_file", file,
                      "moves at up to " + rounded(motion.fastest()) + " m/s, must be at most crane.max_speed_mps (" +
                          formatNumber(scenario.crane.max_speed_mps) + ")");
  }
  checkCraneHolds(scenario, lowestHubHeight(scenario) + motion.lowest(), "at the lowest point of the motion file");
  checkCraneHolds(scenario, lowestHubHeight(scenario) + motion.highest(), "at the highest point of the motion file");
}

void checkCommands(const ProcedureConfig& procedure) {
  if (procedure.commands_file.empty()) return;
  const std::vector<RigCommand> commands = readCommands(procedure.commands_file);
  // As in the simulation, the rest lasts a whole number of samples.
  constexpr double kRoundingS = 1.0;
  if (commands.front().time_s < -procedure.timeBeforeZero() - kRoundingS) {
    throw ConfigError("procedure.commands_file", procedure.commands_file,
                      "begins at " + formatNumber(commands.front().time_s) +
                          " s, before the test: 0 is the end of settling and rest (procedure.settle_duration_s = " +
                          formatNumber(procedure.settle_duration_s) +
                          ", procedure.rest_duration_s = " + formatNumber(procedure.rest_duration_s) + ")");
  }
  if (procedure.control == ControlMode::kManual) return;
  for (const RigCommand& command : commands) {
    if (!command.velocity_mps && !command.fold_target) continue;
    throw ConfigError("procedure.commands_file", procedure.commands_file,
                      "drives the crane or the fold at " + formatNumber(command.time_s) +
                          " s, which needs procedure.control: manual");
  }
}

void checkCrane(const Scenario& scenario) {
  const CraneConfig& crane = scenario.crane;
  const ProcedureConfig& procedure = scenario.procedure;
  require(crane.min_height_m < crane.max_height_m, "crane.min_height_m", crane.min_height_m,
          "must be less than crane.max_height_m (" + formatNumber(crane.max_height_m) + ")");
  checkCraneHolds(scenario, startHubHeight(scenario), "at the start");
  checkCommands(procedure);
  if (procedure.control == ControlMode::kManual) return;  // whoever drives by hand need not follow the script

  if (!procedure.motion_file.empty()) {
    checkCraneMotion(scenario);
  } else {
    checkCraneSpeed(crane, "procedure.lift_speed_mps", procedure.lift_speed_mps);
    checkCraneHolds(scenario, liftEndHubHeight(scenario), "at the end of the lift");
  }
  if (procedure.start == StartPose::kFoldedAboveIce) {
    checkCraneSpeed(crane, "procedure.lower_speed_mps", procedure.lower_speed_mps);
    checkCraneHolds(scenario, lowestHubHeight(scenario), "at the end of lowering");
  }
}

void checkEffects(const Scenario& scenario) {
  for (const EffectValues& effect : scenario.effects.all()) {
    if (!effect.enabled) continue;
    const EffectDescription& description = effect.description();
    if (scenario.output.energy && !description.in_energy_balance) {
      throw ConfigError("output.energy", "true",
                        std::string("must be false with effects.") + description.name +
                            ".enabled: the energy that this effect moves is not followed");
    }
    if (description.check) description.check(effect, scenario);
  }
}

}  // namespace

double sitesAlong(double length_m, double spacing_m) {
  return std::round(length_m / spacing_m);
}

double particleCount(const FieldConfig& field) {
  return sitesAlong(field.length_x_m, field.spacing_m) * sitesAlong(field.length_y_m, field.spacing_m) *
         sitesAlong(field.thickness_m, field.spacing_m);
}

double bytesPerParticle(const SolverConfig& solver) {
  constexpr double kState = 1000.0, kNeighbour = 30.0;
  const double growth =
      solver.smoothing_length == SmoothingLength::kVariable ? smoothingGrowth(solver.volume_ratio_limit) : 1.0;
  const double reach = 2.0 * solver.smoothing_ratio * growth + solver.neighbour_skin_ratio;  // in spacings
  return kState + kNeighbour * 4.0 / 3.0 * kPi * reach * reach * reach;
}

double latticeThickness(const FieldConfig& field) {
  return sitesAlong(field.thickness_m, field.spacing_m) * field.spacing_m;
}

double iceDraft(const Scenario& scenario) {
  return latticeThickness(scenario.field) * scenario.ice.parent_density_kgpm3 / scenario.water.density_kgpm3;
}

double armLength(const CollectorConfig& collector) {
  return std::sqrt(collector.radius_m * collector.radius_m + collector.rim_height_m * collector.rim_height_m);
}

double unfoldedArmAngle(const CollectorConfig& collector) {
  return repeatable::atan(collector.rim_height_m / collector.radius_m);
}

double startHubHeight(const Scenario& scenario) {
  const double gap = scenario.procedure.start_gap_m;
  if (scenario.procedure.start == StartPose::kFoldedAboveIce) {
    return latticeThickness(scenario.field) - iceDraft(scenario) + gap;
  }
  return -iceDraft(scenario) - scenario.collector.rim_height_m - gap;
}

double lowestHubHeight(const Scenario& scenario) {
  if (scenario.procedure.start == StartPose::kUnfoldedUnderIce) return startHubHeight(scenario);
  const CollectorConfig& collector = scenario.collector;
  const double folded_height = armLength(collector) * repeatable::sin(collector.folded_arm_angle_deg * kDegree);
  return -iceDraft(scenario) - folded_height - scenario.procedure.lower_clearance_m;
}

double liftEndHubHeight(const Scenario& scenario) {
  return lowestHubHeight(scenario) + scenario.procedure.lift_speed_mps * scenario.procedure.lift_duration_s;
}

void Scenario::validate() const {
  Scenario copy = *this;  // visit() hands out references that can be written to
  RangeChecker checker;
  copy.visit(checker);

  checkField(field);
  checkSize(field, solver);
  checkFloats(*this);
  checkCollector(*this);
  checkContact(contact);
  checkCrane(*this);
  checkEffects(*this);
}

}  // namespace brash_ice_rig
