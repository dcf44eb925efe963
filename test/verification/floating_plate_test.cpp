// A plate afloat under a line load against the closed form of a beam on an elastic foundation (Hetenyi 1946, chapter
// 2).

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "../sph/elastic_material.h"
#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/sph/kernel.h"
#include "brash_ice_rig/water/water.h"
#include "guided_body.h"

namespace brash_ice_rig {
namespace {

constexpr double kThickness = 1.2, kLoad = 200.0;     // m, N/m; it moves the plate by less than a centimetre
constexpr double kElastic = 9.016e5, kPoisson = 0.3;  // B-1 at 1/1000
constexpr double kBulk = kElastic / (3.0 * (1.0 - 2.0 * kPoisson));
constexpr double kShear = kElastic / (2.0 * (1.0 + kPoisson));
constexpr double kPatch = 0.6;  // width over which the load is spread, m: whole particles at each resolution

/// Deflection of a plate strip without an end, on a foundation k w and with shear stiffness S (Timoshenko), under a
/// line load P. With D = E t^3 / (12 (1 - nu^2)), a^2 = k/D and 2b = k/S the Fourier integral of
///   D w'''' - (D k/S) w'' + k w = P (delta - (D/S) delta'')
/// gives w(0) = P (1/a + D/S) / (2 D sqrt(2 (a + b))); for stiff shear P lambda / (2k) with lambda^4 = k/(4D),
/// Hetenyi's eq. 5. Away from the load w is exp(-p x) times cosine and sine of q x, p^2 = (a + b)/2, q^2 = (a - b)/2,
/// and the slope beside the load is that of shear alone, -P / (2S).
class FloatingStrip {
 public:
  /// @param foundation_npm3  k, N/m per m²
  /// @param shear_factor     share of G t that resists shear; infinity: none of the deflection is shear
  /// @param bending_ratio   factor on the bending stiffness D
  FloatingStrip(double foundation_npm3, double shear_factor, double bending_ratio = 1.0) {
    const double bending = bending_ratio * kElastic * std::pow(kThickness, 3) / (12.0 * (1.0 - kPoisson * kPoisson));
    const double shear = shear_factor * kShear * kThickness;
    const double a = std::sqrt(foundation_npm3 / bending), b = 0.5 * foundation_npm3 / shear;
    decay_ = std::sqrt(0.5 * (a + b));
    wave_ = std::sqrt(0.5 * (a - b));
    cosine_ = kLoad * (1.0 / a + bending / shear) / (2.0 * bending * std::sqrt(2.0 * (a + b)));
    sine_ = (decay_ * cosine_ - 0.5 * kLoad / shear) / wave_;
  }

  /// m, under the load spread over kPatch, by the midpoint rule in 60 parts.
  double deflection(double x) const {
    constexpr int kParts = 60;
    double sum = 0.0;
    for (int k = 0; k < kParts; ++k) sum += point(x + kPatch * ((k + 0.5) / kParts - 0.5)) / kParts;
    return sum;
  }
  /// m
  double length() const { return 1.0 / decay_; }

 private:
  double point(double x) const {
    const double way = std::abs(x);
    return std::exp(-decay_ * way) * (cosine_ * std::cos(wave_ * way) + sine_ * std::sin(wave_ * way));
  }
  double decay_, wave_, cosine_, sine_;
};

/// Bending stiffness of a plate of n layers of particles over that of the plate. In bending the strain grows with the
/// height z over the middle. The corrected gradient sees a bilinear field x z at the place where the neighbours are on
/// average, weighted with x^2 W'/r: in the two outermost layers on either side, which lack neighbours beyond the
/// surface, further inside. Since the force is the adjoint of the gradient, the sum of the squares of these heights is
/// what resists.
double latticeBendingRatio(int layers) {
  const CubicSpline kernel{1.2};
  double squares = 0.0;
  for (int layer = 0; layer < layers; ++layer) {
    double height = 0.0, weight = 0.0;
    for (int other = std::max(layer - 2, 0); other <= std::min(layer + 2, layers - 1); ++other)
      for (int x = -2; x <= 2; ++x)
        for (int y = -2; y <= 2; ++y) {
          const double r = std::sqrt(x * x + y * y + (other - layer) * (other - layer));
          if (x == 0) continue;
          const double share = kernel.derivative(r) / r * x * x;
          height += share * (other + 0.5 - 0.5 * layers);
          weight += share;
        }
    squares += std::pow(height / weight, 2);
  }
  return 12.0 * squares / std::pow(layers, 3);
}

/// Deflection of each column of a strip of SPH particles, in plane strain, afloat on the rig's water.
struct Deflection {
  std::vector<double> x_m, down_m;
};
Deflection measureDeflection(int layers, double length_m) {
  const double dx = kThickness / layers;
  const IceConfig ice;
  const WaterConfig sea;
  const double density = ice.parent_density_kgpm3 * (1.0 - ice.void_fraction);
  const double draft = ice.parent_density_kgpm3 / sea.density_kgpm3 * kThickness;
  // As odd or even as the columns under the load, so that the two have one middle.
  const int columns =
      static_cast<int>(std::lround(kPatch / dx)) + 2 * static_cast<int>(std::lround(0.5 * length_m / dx));
  constexpr int kSlice = 3;
  std::vector<Eigen::Vector3d> points;
  std::vector<std::size_t> group;
  for (int x = 0; x < columns; ++x)
    for (int y = 0; y < kSlice; ++y)
      for (int z = 0; z < layers; ++z) {
        points.emplace_back(dx * (x + 0.5 - 0.5 * columns), dx * y, dx * (z + 0.5) - draft);
        group.push_back(static_cast<std::size_t>(x * layers + z));
      }
  const ElasticMaterial material(kBulk, kShear);
  GuidedBody body(sliceSettings(dx, density), material, points, std::vector<bool>(points.size(), false), group,
                  {1.0f, 0.0f, 1.0f});
  const ParticleInWater water(sea, ice, dx);
  const auto per_particle = static_cast<float>(kLoad * dx * dx / (kPatch * layers));
  float load = 0.0f;
  const auto external = [&](std::size_t i) -> Eigen::Vector4f {
    Eigen::Vector4f force = water.force(static_cast<float>(body.sph.position()[i].z()), body.sph.velocity(i));
    if (std::abs(points[i].x()) < 0.5 * kPatch) force.z() -= load;
    return force;
  };
  const double time_step = 0.5 * 1.2 * dx / std::sqrt((kBulk + 4.0 / 3.0 * kShear) / density);
  // The plate bobs at sqrt(k / (rho t)) = 3 1/s; twice that is critical damping, and 6 s bring a disturbance to 1e-6.
  const auto rest = [&] {
    for (double time = 0.0; time < 6.0; time += time_step) body.step(time_step, 6.0, external);
    std::vector<double> height(static_cast<std::size_t>(columns), 0.0);
    for (std::size_t i = 0; i < points.size(); ++i) {
      height[group[i] / static_cast<std::size_t>(layers)] += body.sph.position()[i].z() / (kSlice * layers);
    }
    return height;
  };
  const auto unloaded = rest();
  load = per_particle;
  const auto loaded = rest();
  Deflection result;
  for (int x = 0; x < columns; ++x) {
    const auto column = static_cast<std::size_t>(x);
    result.x_m.push_back(dx * (x + 0.5 - 0.5 * columns));
    result.down_m.push_back(unloaded[column] - loaded[column]);
  }
  return result;
}

TEST(FloatingPlate, LineLoadBendsItAsABeamOnAnElasticFoundation) {
  // Buoyancy grows by rho_w (1 - V_f) g per metre of sinking and square metre: the particle at the waterline carries
  // it. 1.2 m of ice is a thick plate on a length of 3.4 m, so that shear counts; its factor, 5/6 to 0.9 in the
  // literature (Cowper 1966), leaves 0.3 % of the deflection open.
  const IceConfig ice;
  const WaterConfig sea;
  const double foundation = sea.density_kgpm3 * (1.0 - ice.void_fraction) * kGravityMps2;
  const FloatingStrip strip(foundation, 5.0 / 6.0), thin(foundation, std::numeric_limits<double>::infinity());
  const double length = 10.0 * strip.length();  // ends where the deflection is e^-5 of the middle's
  report("deflection_without_shear_mm", 1000.0 * thin.deflection(0.0));
  std::vector<int> resolutions = {4, 6};
  if (fineRequested()) resolutions.insert(resolutions.end(), {8, 12});
  double previous = 0.0, previous_layers = 0.0;
  for (const int layers : resolutions) {
    const Deflection found = measureDeflection(layers, length);
    const std::size_t middle = found.x_m.size() / 2, mirrored = found.x_m.size() - 1 - middle;
    const double central = found.down_m[middle], at = found.x_m[middle], expected = strip.deflection(at);
    const double error = central / expected - 1.0;
    const double bending = latticeBendingRatio(layers);
    const FloatingStrip lattice(foundation, 5.0 / 6.0, bending);
    const double predicted = lattice.deflection(at) / expected - 1.0;
    double squares = 0.0;
    for (std::size_t k = 0; k < found.x_m.size(); ++k) {
      squares += std::pow(found.down_m[k] - lattice.deflection(found.x_m[k]), 2);
    }
    const double rms = std::sqrt(squares / static_cast<double>(found.x_m.size())) / expected;
    const std::string with = "_with_" + std::to_string(layers) + "_layers";
    report("central_deflection_mm" + with, 1000.0 * central);
    report("closed_form_mm" + with, 1000.0 * expected);
    report("error_percent" + with, 100.0 * error);
    report("lattice_bending_stiffness_over_exact" + with, bending);
    report("predicted_error_percent" + with, 100.0 * predicted);
    report("profile_rms_over_central_percent" + with, 100.0 * rms);
    EXPECT_NEAR(error, predicted, 0.003 + 0.33 * predicted);
    EXPECT_LT(rms, 0.003 + 0.33 * predicted);
    EXPECT_NEAR(found.down_m[mirrored], central, 1.0e-3 * central);
    if (previous_layers > 0.0) {
      const double order = std::log(previous / error) / std::log(layers / previous_layers);
      report("order" + with, order);
      EXPECT_NEAR(order, 2.0, 0.4);
    }
    previous = error;
    previous_layers = layers;
  }
}

}  // namespace
}  // namespace brash_ice_rig
