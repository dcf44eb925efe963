#include <algorithm>
#include <cmath>
#include <random>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/effects/effect.h"

namespace brash_ice_rig {
namespace {

/// Uniform in [-1, 1). Written out because the standard leaves its distributions to the library.
double symmetricUnit(std::mt19937_64& generator) {
  return static_cast<double>(generator() >> 11) * std::ldexp(1.0, -52) - 1.0;
}

/// Square patches of the field, at a random place and with random thickness. Over all particles the mean of the
/// thickness is that of the scenario, its standard deviation sd_ratio of it.
///
/// Columns keep their number of particles; a column is stretched about the waterline, which keeps it afloat, and its
/// particles have its share of volume and mass.
class ThicknessField : public Effect {
 public:
  explicit ThicknessField(const EffectValues& values)
      : sd_ratio_(values["sd_ratio"]), patch_(values["patch_m"]), seed_(static_cast<std::uint64_t>(values["seed"])) {}

  void createField(FieldAtCreation& field) override {
    const FieldConfig& config = field.scenario.field;
    std::mt19937_64 generator(seed_);
    const double shift_x = 0.5 * (1.0 + symmetricUnit(generator)), shift_y = 0.5 * (1.0 + symmetricUnit(generator));
    const auto along_x = static_cast<std::size_t>(std::ceil(config.length_x_m / patch_)) + 2;
    const auto along_y = static_cast<std::size_t>(std::ceil(config.length_y_m / patch_)) + 2;
    std::vector<double> patches(along_x * along_y);
    for (double& patch : patches) patch = symmetricUnit(generator);

    const std::size_t count = field.position_m.size();
    std::vector<double> deviation(count);
    double sum = 0.0, squares = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Vector3d& p = field.position_m[i];
      // Jitter may take a particle out of the box by less than a patch's margin on each side.
      const double x = (p.x() + 0.5 * config.length_x_m) / patch_ + shift_x + 0.5;
      const double y = (p.y() + 0.5 * config.length_y_m) / patch_ + shift_y + 0.5;
      const auto cell_x = std::min(static_cast<std::size_t>(std::max(x, 0.0)), along_x - 1);
      const auto cell_y = std::min(static_cast<std::size_t>(std::max(y, 0.0)), along_y - 1);
      deviation[i] = patches[cell_x * along_y + cell_y];
      sum += deviation[i];
      squares += deviation[i] * deviation[i];
    }
    const double mean = sum / static_cast<double>(count);
    const double spread = std::sqrt(squares / static_cast<double>(count) - mean * mean);
    const double reach = armLength(field.scenario.collector) + config.spacing_m;
    double thickest = 1.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double ratio = std::max(1.0 + sd_ratio_ * (deviation[i] - mean) / spread, kLeastRatio);
      Eigen::Vector3d& p = field.position_m[i];
      p.z() *= ratio;
      field.volume_ratio[i] *= static_cast<float>(ratio);
      field.solid_ratio[i] *= static_cast<float>(ratio);
      if (p.head<2>().squaredNorm() < reach * reach) thickest = std::max(thickest, ratio);
    }
    field.bottom_rise_m -= (thickest - 1.0) * iceDraft(field.scenario);
  }

 private:
  static constexpr double kLeastRatio = 0.4;  // far beyond what the spread can reach; see the range of sd_ratio

  double sd_ratio_, patch_;
  std::uint64_t seed_;
};

void checkPatches(const EffectValues& values, const Scenario& scenario) {
  const double patch = values["patch_m"];
  const double most = std::sqrt(scenario.field.length_x_m * scenario.field.length_y_m / 5.0);
  if (patch <= most) return;
  // Rounded down: the figure in the message must be good enough when it is typed in.
  throw ConfigError(
      "effects.thickness_field.patch_m", formatNumber(patch),
      "must be at most " + formatNumber(std::floor(most * 1000.0) / 1000.0) + ", so that the field holds 5 patches");
}

}  // namespace

EffectDescription describeThicknessField() {
  EffectDescription d;
  d.name = "thickness_field";
  d.mechanism = "the ice is thicker in some patches than in others";
  d.parameters = {
      amplitude("sd_ratio", "1", 0.05, {0.0, 0.2}, {PriorKind::kHalfNormal, 0.0, 0.05}, false,
                "standard deviation of the thickness over its mean"),
      shape("patch_m", "m", 1.5, {0.3, 50.0}, {PriorKind::kLogNormal, 1.5, 0.5}, "side of a patch"),
      wholeSetting("seed", 1.0, {0.0, 9007199254740992.0}, "selects place and thickness of the patches"),
  };
  d.confusable_with = {"pole_tilt", "porosity_gradient"};
  d.how_to_tell = "drilled thickness around the spot, or lifts in several spots";
  d.changes_mass = true;
  d.make = [](const EffectValues& values, const Scenario&) { return std::make_unique<ThicknessField>(values); };
  d.check = checkPatches;
  return d;
}

}  // namespace brash_ice_rig
