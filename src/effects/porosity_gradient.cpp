#include <algorithm>
#include <cmath>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/effects/effect.h"

namespace brash_ice_rig {
namespace {

/// The void fraction grows with depth: V_f(z) = V_f + c (d(z) / h - mean of d / h), d the depth below the top of the
/// ice of thickness h. The mean over the field stays. Weight, buoyancy, drag and inertia follow the ice in each
/// particle; stiffness and strength stay those of the mean.
///
/// Ice that is denser below floats higher, so the field is set to its own equilibrium.
class PorosityGradient : public Effect {
 public:
  explicit PorosityGradient(double contrast) : contrast_(contrast) {}

  void createField(FieldAtCreation& field) override {
    const Scenario& s = field.scenario;
    const double thickness = latticeThickness(s.field), solid = 1.0 - s.ice.void_fraction;
    const std::size_t count = field.position_m.size();
    double mean = 0.0;
    for (const Eigen::Vector3d& p : field.position_m) mean += p.z() / static_cast<double>(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double depth = (mean - field.position_m[i].z()) / thickness;  // below the middle
      field.solid_ratio[i] *= static_cast<float>((solid - contrast_ * depth) / solid);
    }
    const double rise = floatingRise(field);
    for (Eigen::Vector3d& p : field.position_m) p.z() += rise;
    field.bottom_rise_m += rise;
  }

 private:
  /// How far all particles have to go up for their weight to equal their buoyancy, m.
  static double floatingRise(const FieldAtCreation& field) {
    const Scenario& s = field.scenario;
    const ParticleInWater water(s.water, s.ice, s.field.spacing_m);
    const auto lift = [&](double rise) {
      double sum = 0.0;
      for (std::size_t i = 0; i < field.position_m.size(); ++i) {
        const auto height = static_cast<float>(field.position_m[i].z() + rise);
        const float net = water.buoyancy(water.submerged(height)) - water.weight();
        sum += static_cast<double>(field.solid_ratio[i]) * static_cast<double>(net);
      }
      return sum;
    };
    double low = -latticeThickness(s.field), high = -low;  // all under water, all above it
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (low + high);
      (lift(middle) > 0.0 ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }

  double contrast_;
};

void checkVoids(const EffectValues& values, const Scenario& scenario) {
  const double contrast = values["contrast"], voids = scenario.ice.void_fraction;
  const double most = 2.0 * std::min(voids, 1.0 - voids);
  if (std::abs(contrast) < most) return;
  throw ConfigError("effects.porosity_gradient.contrast", formatNumber(contrast),
                    "must be between -" + formatNumber(most) + " and " + formatNumber(most) +
                        ", or the void fraction leaves (0, 1) at top or bottom");
}

}  // namespace

EffectDescription describePorosityGradient() {
  EffectDescription d;
  d.name = "porosity_gradient";
  d.mechanism = "the void fraction varies with depth";
  d.parameters = {amplitude("contrast", "1", 0.2, {-1.0, 1.0}, {PriorKind::kNormal, 0.0, 0.2}, true,
                            "void fraction at the bottom less that at the top; its mean stays")};
  d.confusable_with = {"thickness_field", "drainage"};
  d.how_to_tell = "cores or pits: it changes the force only while the plug leaves the water";
  d.changes_mass = true;
  d.make = [](const EffectValues& values, const Scenario&) {
    return std::make_unique<PorosityGradient>(values["contrast"]);
  };
  d.check = checkVoids;
  return d;
}

}  // namespace brash_ice_rig
