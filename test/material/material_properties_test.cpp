// What each constitutive law must keep. A new one is added to the list at the end, with its own yield surface.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "brash_ice_rig/ice/ice_scaling.h"
#include "brash_ice_rig/material/cap_model.h"
#include "element.h"

namespace brash_ice_rig {
namespace {

using Components = std::array<double, kComponents>;

// ------------------------------------------------------------------------------------- the cap model, written plainly
// Equations 7 to 12 as they stand in theory.md, in double and without regard to speed.

struct PlainState {
  Components stress;
  double compaction = 0.0, plastic_strain = 0.0;
};

class PlainCapModel {
 public:
  explicit PlainCapModel(const CapParameters& p) : p_(p) {}

  /// Eq. 12 for X by bisection.
  double intercept(double e) const {
    if (!(e > 0.0)) return p_.initial_intercept_pa;
    const auto strain = [&](double x) {
      const double y = x - p_.initial_intercept_pa;
      return p_.max_compaction * -std::expm1(-p_.d1_per_pa * y - p_.d2_per_pa2 * y * y);
    };
    const double limit = 0.9999 * p_.max_compaction;
    double low = p_.initial_intercept_pa, high = low + 10.0 / p_.d1_per_pa;
    for (int i = 0; i < 70; ++i) {
      const double middle = 0.5 * (low + high);
      (strain(middle) < std::min(e, limit) ? low : high) = middle;
    }
    if (e <= limit) return low;
    const double y = low - p_.initial_intercept_pa;
    return low + (e - limit) / ((p_.max_compaction - limit) * (p_.d1_per_pa + 2.0 * p_.d2_per_pa2 * y));
  }

  double lodeFactor(const Components& stress) const {
    const Components d = deviator(stress);
    const double s = norm(d);
    if (!p_.three_invariant || s == 0.0) return 1.0;
    Eigen::Matrix3d matrix;
    matrix << d[0], d[3], d[5], d[3], d[1], d[4], d[5], d[4], d[2];
    const double j3 = (matrix / s).determinant();
    const double beta = std::asin(std::max(-1.0, std::min(1.0, -1.5 * std::sqrt(3.0) * j3))) / 3.0;
    const double q1 = 0.5673, q2 = 0.5;
    const double a1 = std::sqrt(3.0) * q2 + 2.0 * q1 * (q2 - 1.0), a0 = 2.0 * q1 * q1 * (q2 - 1.0);
    const double a = (-a1 + std::sqrt(a1 * a1 - 4.0 * q2 * a0)) / (2.0 * q2), b = std::pow(2.0 * q1 + a, 2) - 3.0;
    const double b2 = std::pow(std::cos(beta) - a * std::sin(beta), 2) + b * std::pow(std::sin(beta), 2);
    const double b1 = a * (std::cos(beta) - a * std::sin(beta)), b0 = -(3.0 + b - a * a) / 4.0;
    return (-b1 + std::sqrt(b1 * b1 - 4.0 * b2 * b0)) / (2.0 * b2);
  }

  /// F_f sqrt(F_c), 0 outside apex and cap.
  double strength(double j1, double e) const {
    const double x = intercept(e), l = start(x), cone = p_.alpha_pa + p_.theta * j1;
    if (cone <= 0.0 || j1 >= x) return 0.0;
    return cone * std::sqrt(j1 > l ? 1.0 - std::pow((j1 - l) / (x - l), 2) : 1.0);
  }

  /// Outside the surface by more than `tolerance` in J1 and s.
  bool isOutside(const Components& stress, double e, double tolerance) const {
    const double j1 = -(stress[0] + stress[1] + stress[2]), s = norm(deviator(stress));
    const double factor = lodeFactor(stress);
    if (j1 + tolerance < -p_.alpha_pa / p_.theta || j1 - tolerance > intercept(e)) return true;
    double best = 0.0;
    for (const double shift : {-1.0, 0.0, 1.0}) best = std::max(best, strength(j1 + shift * tolerance, e));
    return s > factor * best + tolerance;
  }

  /// Backward Euler by nested bisection on 2 G F x = 3 (s_tr - F) m with m = -dF²/dJ1.
  void update(PlainState& state, const Components& strain) const {
    const double k = p_.bulk_modulus_pa, volume = strain[0] + strain[1] + strain[2];
    Components trial = state.stress;
    for (std::size_t c = 0; c < kComponents; ++c) {
      trial[c] += 2.0 * p_.shear_modulus_pa * (strain[c] - (c < 3 ? volume / 3.0 : 0.0)) + (c < 3 ? k * volume : 0.0);
    }
    const double j1_trial = -(trial[0] + trial[1] + trial[2]);
    const Components d = deviator(trial);
    const double s_trial = norm(d), factor = lodeFactor(trial), apex = -p_.alpha_pa / p_.theta, e0 = state.compaction;
    state.stress = trial;
    if (j1_trial >= apex && j1_trial <= intercept(e0) && s_trial <= factor * strength(j1_trial, e0)) return;

    const auto j1At = [&](double x) { return j1_trial - 3.0 * k * x; };
    const auto f = [&](double x) { return factor * strength(j1At(x), e0 + x); };
    const auto m = [&](double x) {
      const double cap = intercept(e0 + x), l = start(cap), j1 = j1At(x), cone = p_.alpha_pa + p_.theta * j1;
      const double t = std::max(0.0, (j1 - l) / (cap - l));
      const double shear_part = p_.flow_rule == FlowRule::kAssociated ? 2.0 * p_.theta * cone * (1.0 - t * t) : 0.0;
      return factor * factor * (cone * cone * 2.0 * t / (cap - l) - shear_part);
    };
    const auto bisect = [](double negative, double positive, const std::function<double(double)>& function) {
      for (int i = 0; i < 70; ++i) {
        const double middle = 0.5 * (negative + positive);
        (function(middle) < 0.0 ? negative : positive) = middle;
      }
      return 0.5 * (negative + positive);
    };

    const double x_apex = (j1_trial - apex) / (3.0 * k);
    double x = 0.0, s = 0.0;
    const bool compacts = j1_trial > apex && m(0.0) > 0.0;
    if (compacts) {
      // s_tr counts as at least a trace, so that pure compression ends at the tip of the cap.
      const double trace = std::max(s_trial, 1e-9 * p_.alpha_pa);
      const double x_neutral = bisect(0.0, x_apex, [&](double v) { return m(v) > 0.0 ? -1.0 : 1.0; });
      x = bisect(0.0, x_neutral, [&](double v) {
        return j1At(v) >= intercept(e0 + v) ? -1.0 : 2.0 * p_.shear_modulus_pa * f(v) * v - 3.0 * (trace - f(v)) * m(v);
      });
      s = f(x);
    } else if (p_.flow_rule == FlowRule::kNonAssociated) {
      x = std::min(0.0, x_apex);
      s = f(x);
    } else if (x_apex <= 0.0 && p_.shear_modulus_pa * x_apex + 3.0 * p_.theta * factor * s_trial <= 0.0) {
      x = x_apex;
    } else {
      const double start_x = std::min(0.0, x_apex);
      const double x_neutral = bisect(start_x, (j1_trial - intercept(e0)) / (3.0 * k), m);
      x = bisect(x_neutral, start_x,
                 [&](double v) { return 2.0 * p_.shear_modulus_pa * f(v) * v - 3.0 * (s_trial - f(v)) * m(v); });
      s = f(x);
    }
    for (std::size_t c = 0; c < kComponents; ++c) {
      state.stress[c] = (s_trial > 0.0 ? s / s_trial : 0.0) * d[c] - (c < 3 ? j1At(x) / 3.0 : 0.0);
    }
    state.compaction = std::max(0.0, e0 + x);
    state.plastic_strain += (s_trial - s) / (std::sqrt(3.0) * p_.shear_modulus_pa);
  }

  static Components deviator(Components stress) {
    const double mean = (stress[0] + stress[1] + stress[2]) / 3.0;
    for (std::size_t c = 0; c < 3; ++c) stress[c] -= mean;
    return stress;
  }
  static double norm(const Components& d) {
    return std::sqrt(0.5 * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) + d[3] * d[3] + d[4] * d[4] + d[5] * d[5]);
  }

 private:
  double start(double x) const { return (x - p_.aspect_ratio * p_.alpha_pa) / (1.0 + p_.aspect_ratio * p_.theta); }

  CapParameters p_;
};

// ------------------------------------------------------------------------------------------------------------- models

struct Model {
  std::string name;
  CapParameters parameters;
};

std::ostream& operator<<(std::ostream& out, const Model& model) {
  return out << model.name;
}

std::vector<Model> models() {
  IceConfig ice;
  ice.damage = false;
  ice.gap_memory = false;
  std::vector<Model> result{{"CapAssociated", makeCapParameters(ice, 1e-3, 0.3)}};
  result.push_back({"CapAssociatedFullStiffness", makeCapParameters(ice, 1.0, 0.3)});
  ice.flow_rule = FlowRule::kNonAssociated;
  result.push_back({"CapNonAssociated", makeCapParameters(ice, 1e-3, 0.3)});
  ice.three_invariant = true;
  result.push_back({"CapNonAssociatedThreeInvariant", makeCapParameters(ice, 1e-3, 0.3)});
  ice.flow_rule = FlowRule::kAssociated;
  result.push_back({"CapThreeInvariant", makeCapParameters(ice, 1e-3, 0.3)});
  ice.three_invariant = false;
  ice.gap_memory = true;
  result.push_back({"CapWithGapMemory", makeCapParameters(ice, 1e-3, 0.3)});
  ice.damage = true;
  result.push_back({"CapWithDamageAndGapMemory", makeCapParameters(ice, 1e-3, 0.3)});
  ice.gap_memory = false;
  result.push_back({"CapWithDamage", makeCapParameters(ice, 1e-3, 0.3)});
  ice.damage = false;  // B-5 as printed: a small cap that hardens at once
  ice.shear_constant_pa = 200.0;
  ice.shear_slope = 0.469;
  ice.cap_initial_intercept_pa = 4000.0;
  ice.cap_hardening_linear_per_pa = 386.0e-6;
  result.push_back({"CapOfB5", makeCapParameters(ice, 1e-3, 0.3)});
  return result;
}

class MaterialProperties : public ::testing::TestWithParam<Model> {
 protected:
  MaterialProperties() : parameters_(GetParam().parameters), material_(parameters_), plain_(parameters_) {}

  Components randomStrain(double size) {
    Components strain{};
    for (double& value : strain) value = size * normal_(generator_);
    const double mean = size * normal_(generator_);
    for (std::size_t c = 0; c < 3; ++c) strain[c] += mean;
    return strain;
  }
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(generator_); }

  /// A path that turns every few steps, with strains from far below the elastic limit to far beyond it.
  void walk(Element& element, int steps, double log_min, double log_max, const std::function<void(Components)>& check) {
    Components strain{};
    for (int i = 0; i < steps; ++i) {
      if (i % 7 == 0) strain = randomStrain(std::pow(10.0, uniform(log_min, log_max)));
      element.strain(strain);
      check(strain);
    }
  }

  static Components stressOf(const Element& element) {
    Components stress{};
    for (std::size_t c = 0; c < kComponents; ++c) stress[c] = element.stress(c);
    return stress;
  }
  static constexpr const char* kStrainNames[] = {"strain_xx", "strain_yy", "strain_zz",
                                                 "strain_xy", "strain_yz", "strain_zx"};
  static Components totalStrainOf(const Element& element) {
    Components strain{};
    for (std::size_t c = 0; c < kComponents; ++c) strain[c] = element.state(kStrainNames[c]);
    return strain;
  }
  static void setTotalStrain(Element& element, const Components& strain) {
    for (std::size_t c = 0; c < kComponents; ++c) element.setState(kStrainNames[c], strain[c]);
  }
  std::vector<std::string> scalarStates() const {
    std::vector<std::string> names = material_.stateNames();
    names.resize(names.size() - kComponents * material_.stateTensors());
    return names;
  }
  static double sizeOf(const Components& values) {
    double size = 0.0;
    for (const double value : values) size = std::max(size, std::abs(value));
    return size;
  }

  /// Many points at random places in and on the surface, as arrays.
  struct Cloud {
    std::array<std::vector<float>, kComponents> strain, stress;
    std::vector<std::vector<float>> state;

    MaterialBatch batch(std::size_t begin, std::size_t count) {
      MaterialBatch result;
      result.count = count;
      for (std::size_t c = 0; c < kComponents; ++c) {
        result.strain_increment[c] = strain[c].data() + begin;
        result.stress[c] = stress[c].data() + begin;
      }
      for (std::vector<float>& values : state) result.state.push_back(values.data() + begin);
      return result;
    }
  };
  Cloud makeCloud(std::size_t count, int steps) {
    Cloud cloud;
    for (auto& values : cloud.strain) values.resize(count);
    for (auto& values : cloud.stress) values.assign(count, 0.0f);
    cloud.state.assign(material_.stateNames().size(), std::vector<float>(count, 0.0f));
    for (int i = 0; i <= steps; ++i) {
      for (std::size_t n = 0; n < count; ++n) {
        const double yield_strain = parameters_.alpha_pa / material_.shearModulus();
        const Components strain = randomStrain(yield_strain * std::pow(10.0, uniform(-3.0, 1.5)));
        for (std::size_t c = 0; c < kComponents; ++c) cloud.strain[c][n] = static_cast<float>(strain[c]);
      }
      MaterialBatch batch = cloud.batch(0, count);
      if (i < steps) material_.update(batch);
    }
    return cloud;
  }

  CapParameters parameters_;
  CapModel material_;
  PlainCapModel plain_;
  std::mt19937_64 generator_{20240229};
  std::normal_distribution<double> normal_;
};

TEST_P(MaterialProperties, ReportsItsModuli) {
  Element element(material_);
  element.strain({-1e-9, -1e-9, -1e-9, 0.0, 0.0, 0.0});
  EXPECT_NEAR(element.j1() / 9e-9, material_.bulkModulus(), 1e-5 * material_.bulkModulus());
  Element sheared(material_);
  sheared.strain({0.0, 0.0, 0.0, 1e-9, 0.0, 0.0});
  EXPECT_NEAR(sheared.stress(3) / 2e-9, material_.shearModulus(), 1e-5 * material_.shearModulus());
}

TEST_P(MaterialProperties, HasPlasticStrainAmongItsState) {
  const std::vector<std::string> names = material_.stateNames();
  EXPECT_EQ(std::count(names.begin(), names.end(), "plastic_strain"), 1);
}

TEST_P(MaterialProperties, ZeroStrainChangesNothing) {
  for (int path = 0; path < 300; ++path) {
    Element element(material_);
    walk(element, 30, -6.0, path % 3 == 0 ? 0.0 : -2.0, [](const Components&) {});
    const Element before = element;
    element.strain({0.0, 0.0, 0.0, 0.0, 0.0, 0.0});
    for (std::size_t c = 0; c < kComponents; ++c) ASSERT_EQ(element.stress(c), before.stress(c)) << "path " << path;
    for (const std::string& name : material_.stateNames()) {
      ASSERT_EQ(element.state(name), before.state(name)) << name << ", path " << path;
    }
  }
}

TEST_P(MaterialProperties, IsObjective) {
  const auto rotate = [](const Components& v, const Eigen::Matrix3d& rotation) {
    Eigen::Matrix3d matrix;
    matrix << v[0], v[3], v[5], v[3], v[1], v[4], v[5], v[4], v[2];
    matrix = (rotation * matrix * rotation.transpose()).eval();
    return Components{matrix(0, 0), matrix(1, 1), matrix(2, 2), matrix(0, 1), matrix(1, 2), matrix(2, 0)};
  };
  for (int path = 0; path < 200; ++path) {
    const Eigen::Matrix3d rotation =
        Eigen::Quaterniond(normal_(generator_), normal_(generator_), normal_(generator_), normal_(generator_))
            .normalized()
            .toRotationMatrix();
    Element element(material_), rotated(material_);
    Element before = element;
    walk(element, 30, -6.0, -2.0, [&](const Components& strain) {
      rotated.setStress(rotate(stressOf(before), rotation));
      for (const std::string& name : material_.stateNames()) rotated.setState(name, before.state(name));
      if (material_.stateTensors() > 0) setTotalStrain(rotated, rotate(totalStrainOf(before), rotation));
      rotated.strain(rotate(strain, rotation));
      const Components expected = rotate(stressOf(element), rotation);
      // The increment is added in float: its rounding counts with the size of the elastic trial.
      const double trial = sizeOf(stressOf(before)) + 5.0 * material_.bulkModulus() * sizeOf(strain);
      // Damage follows its measure with a rate of tens per part, and so does the rounding of it.
      const double tolerance = 2e-6 * trial + 2e-4 + (parameters_.damages ? 5e-5 * sizeOf(expected) : 0.0);
      for (std::size_t c = 0; c < kComponents; ++c) ASSERT_NEAR(rotated.stress(c), expected[c], tolerance);
      for (const std::string& name : scalarStates()) {
        // Thresholds of damage are roots of energies; damage itself grows by hundreds per strain.
        const double scale = name.find("threshold") != std::string::npos ? std::sqrt(material_.bulkModulus())
                             : name.find("damage") != std::string::npos  ? 500.0
                                                                         : 1.0;
        ASSERT_NEAR(
            rotated.state(name), element.state(name),
            2e-6 * (scale * sizeOf(strain) + element.state(name)) + 1e-6 * scale * trial / material_.shearModulus())
            << name;
      }
      before = element;
    });
    if (HasFatalFailure()) return;
  }
}

TEST_P(MaterialProperties, StaysInsideTheSurface) {
  for (int path = 0; path < 2000; ++path) {
    Element element(material_);
    const bool extreme = path % 4 == 0;
    walk(element, 42, extreme ? -3.0 : -7.0, extreme ? 3.0 : -2.0, [&](const Components&) {
      // The surface holds for the undamaged stress.
      Components stress = stressOf(element);
      for (double& value : stress) value /= parameters_.damages ? 1.0 - element.state("damage") : 1.0;
      // Float keeps six to seven digits of stress and compaction.
      const double resolved = element.state("compaction") * (1.0 + 1.2e-7);
      const double tolerance = 1.5e-6 * (parameters_.alpha_pa + std::abs(stress[0] + stress[1] + stress[2]));
      ASSERT_FALSE(plain_.isOutside(stress, resolved, tolerance))
          << "path " << path << ", J1 " << element.j1() << ", s " << element.s() << ", e "
          << element.state("compaction");
      ASSERT_GE(element.state("compaction"), 0.0);
    });
    if (HasFatalFailure()) return;
  }
}

TEST_P(MaterialProperties, DissipationIsNotNegative) {
  if (parameters_.damages) GTEST_SKIP() << "the recovered modulus of the CSCM gives energy back, see doc/theory.md";
  const double g = material_.shearModulus(), k = material_.bulkModulus();
  double total = 0.0;
  for (int path = 0; path < 1000; ++path) {
    Element element(material_);
    Components before{};
    walk(element, 42, -6.0, -1.0, [&](const Components& strain) {
      const Components stress = stressOf(element);
      Components change{};
      for (std::size_t c = 0; c < kComponents; ++c) change[c] = stress[c] - before[c];
      const double mean = (change[0] + change[1] + change[2]) / 3.0;
      double work = 0.0;
      for (std::size_t c = 0; c < kComponents; ++c) {
        const double elastic = (change[c] - (c < 3 ? mean : 0.0)) / (2.0 * g) + (c < 3 ? mean / (3.0 * k) : 0.0);
        work += (c < 3 ? 1.0 : 2.0) * stress[c] * (static_cast<double>(static_cast<float>(strain[c])) - elastic);
      }
      // Rounding of the stress to float, as elastic strain.
      const double rounding = 2e-6 * sizeOf(stress) * (sizeOf(stress) + sizeOf(before)) / g;
      ASSERT_GE(work, -rounding) << "path " << path << ", J1 " << element.j1() << ", s " << element.s();
      total += work;
      before = stress;
    });
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(total, 0.0);
}

TEST_P(MaterialProperties, FiniteInputGivesFiniteOutput) {
  const double largest = static_cast<double>(std::numeric_limits<float>::max());
  std::vector<double> values{0.0};
  for (const double size : {1e-45, 1e-38, 1e-20, 1e-7, 1e-3, 1.0, 1e3, 1e10, 1e20, 1e30, 3e37, largest}) {
    values.push_back(size);
    values.push_back(-size);
  }
  const auto pick = [&] { return values[static_cast<std::size_t>(uniform(0.0, 0.999999) * values.size())]; };
  for (int trial = 0; trial < 20000; ++trial) {
    Element element(material_);
    Components strain{}, stress{};
    for (double& value : strain) value = pick();
    for (double& value : stress) value = pick();
    if (trial % 3 == 0) strain[1] = strain[2] = strain[0];
    element.setStress(stress);
    for (const std::string& name : material_.stateNames()) element.setState(name, std::abs(pick()));
    element.strain(strain);
    for (std::size_t c = 0; c < kComponents; ++c) ASSERT_TRUE(std::isfinite(element.stress(c))) << "trial " << trial;
    for (const std::string& name : material_.stateNames()) {
      ASSERT_TRUE(std::isfinite(element.state(name))) << name << ", trial " << trial;
    }
  }
}

TEST_P(MaterialProperties, NanGivesNanAndHarmsNoNeighbour) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::size_t count = 40;
  const Cloud clean = makeCloud(count, 5);
  Cloud expected = clean;
  MaterialBatch batch = expected.batch(0, count);
  material_.update(batch);
  for (std::size_t source = 0; source <= 2 * kComponents; ++source) {
    Cloud cloud = clean;
    const std::size_t sick = 3 * source;
    (source < kComponents       ? cloud.strain[source]
     : source < 2 * kComponents ? cloud.stress[source - kComponents]
                                : cloud.state[0])[sick] = nan;
    batch = cloud.batch(0, count);
    material_.update(batch);
    for (std::size_t n = 0; n < count; ++n) {
      for (std::size_t c = 0; c < kComponents; ++c) {
        if (n == sick) {
          EXPECT_TRUE(std::isnan(cloud.stress[c][n])) << "source " << source;
        } else {
          EXPECT_EQ(cloud.stress[c][n], expected.stress[c][n]);
        }
      }
    }
  }
}

TEST_P(MaterialProperties, BatchEqualsThePlainEquations) {
  const std::size_t count = 1500;
  for (const int steps : {0, 1, 12}) {
    Cloud cloud = makeCloud(count, steps);
    const Cloud before = cloud;
    MaterialBatch batch = cloud.batch(0, count);
    material_.update(batch);
    int plastic = 0;
    for (std::size_t n = 0; n < count; ++n) {
      PlainState plain;
      Components strain{};
      for (std::size_t c = 0; c < kComponents; ++c) {
        plain.stress[c] = static_cast<double>(before.stress[c][n]);
        strain[c] = static_cast<double>(before.strain[c][n]);
      }
      plain.compaction = static_cast<double>(before.state[0][n]);
      plain.plastic_strain = static_cast<double>(before.state[1][n]);
      const double old_plastic_strain = plain.plastic_strain;
      // A gap that closes is not part of the plain equations; damage is as far as it was at the start of the step.
      const auto gap = parameters_.gap_memory ? before.state[2][n] : 0.0f;
      if (gap > 0.0f) continue;
      const std::size_t damage_index = parameters_.gap_memory ? 3 : 2;
      const auto damageIn = [&](const Cloud& c) {
        return parameters_.damages ? static_cast<double>(c.state[damage_index][n]) : 0.0;
      };
      for (double& value : plain.stress) value /= 1.0 - damageIn(before);
      plain_.update(plain, strain);
      plastic += plain.plastic_strain > old_plastic_strain ? 1 : 0;
      const double size = sizeOf(plain.stress) + parameters_.alpha_pa;
      const double share = 1.0 - damageIn(cloud);
      for (std::size_t c = 0; c < kComponents; ++c) {
        ASSERT_NEAR(static_cast<double>(cloud.stress[c][n]), share * plain.stress[c], 3e-6 * size) << "particle " << n;
      }
      const double strain_size = 1e-6 * sizeOf(strain) + 3e-6 * size / material_.shearModulus();
      ASSERT_NEAR(static_cast<double>(cloud.state[0][n]), plain.compaction, strain_size + 1e-7 * plain.compaction);
      ASSERT_NEAR(static_cast<double>(cloud.state[1][n]), plain.plastic_strain,
                  strain_size + 1e-7 * plain.plastic_strain);
    }
    EXPECT_GT(plastic, 200);
    EXPECT_LT(plastic, 1500);
  }
}

TEST_P(MaterialProperties, SplitOfABatchDoesNotChangeABit) {
  const std::size_t count = 1000;
  Cloud whole = makeCloud(count, 8);
  Cloud split = whole;
  MaterialBatch batch = whole.batch(0, count);
  material_.update(batch);
  const std::size_t sizes[] = {1, 127, 128, 129, 3, 16, 255, 40};
  std::size_t begin = 0;
  for (std::size_t i = 0; begin < count; ++i) {
    const std::size_t size = std::min(sizes[i % 8], count - begin);
    batch = split.batch(begin, size);
    material_.update(batch);
    begin += size;
  }
  const auto same = [&](const std::vector<float>& a, const std::vector<float>& b) {
    return std::memcmp(a.data(), b.data(), count * sizeof(float)) == 0;
  };
  for (std::size_t c = 0; c < kComponents; ++c) EXPECT_TRUE(same(whole.stress[c], split.stress[c]));
  for (std::size_t i = 0; i < whole.state.size(); ++i) EXPECT_TRUE(same(whole.state[i], split.state[i]));
}

INSTANTIATE_TEST_SUITE_P(Models, MaterialProperties, ::testing::ValuesIn(models()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace brash_ice_rig
