#include "brash_ice_rig/material/cap_kernels.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "brash_ice_rig/material/cap_model.h"

namespace brash_ice_rig {
namespace {

// ---------------------------------------------------------------------------------------------------------- functions

class CapKernelsOfSet : public ::testing::TestWithParam<InstructionSet> {
 protected:
  const CapKernels& kernels_ = capKernels(GetParam());
};

double relativeError(double value, double expected) {
  return value == expected ? 0.0 : std::abs(value - expected) / std::abs(expected);
}

TEST_P(CapKernelsOfSet, LogarithmIsThatOfTheLibrary) {
  std::vector<double> x{1.0,
                        0.5,
                        2.0,
                        1e-4,
                        std::sqrt(0.5),
                        std::nextafter(std::sqrt(0.5), 0.0),
                        std::sqrt(2.0),
                        std::numeric_limits<double>::min(),
                        std::numeric_limits<double>::max()};
  std::mt19937_64 generator(3);
  std::uniform_real_distribution<double> uniform;
  for (int i = 0; i < 100000; ++i) x.push_back(uniform(generator));                                // 1 - e / W
  for (int i = 0; i < 100000; ++i) x.push_back(1.0 - std::pow(10.0, -16.0 * uniform(generator)));  // small e
  for (int i = 0; i < 100000; ++i) x.push_back(std::pow(10.0, 600.0 * uniform(generator) - 300.0));
  std::vector<double> y(x.size());
  kernels_.computeLog(x.data(), y.data(), x.size());
  for (std::size_t i = 0; i < x.size(); ++i) ASSERT_LE(relativeError(y[i], std::log(x[i])), 5e-16) << x[i];
  EXPECT_EQ(y[0], 0.0);
}

TEST_P(CapKernelsOfSet, ExponentialIsThatOfTheLibrary) {
  std::vector<double> x{0.0, 1.0, -1.0, 700.0, -700.0};
  std::mt19937_64 generator(4);
  std::uniform_real_distribution<double> uniform;
  for (int i = 0; i < 100000; ++i) x.push_back(1400.0 * uniform(generator) - 700.0);
  for (int i = 0; i < 100000; ++i) x.push_back(-std::pow(10.0, 22.0 * uniform(generator) - 20.0));
  std::vector<double> y(x.size());
  kernels_.computeExp(x.data(), y.data(), x.size());
  for (std::size_t i = 0; i < x.size(); ++i) ASSERT_LE(relativeError(y[i], std::exp(x[i])), 5e-16) << x[i];
  EXPECT_EQ(y[0], 1.0);
  const std::array<double, 2> beyond{-1e300, -std::numeric_limits<double>::infinity()};
  std::array<double, 2> least{};
  kernels_.computeExp(beyond.data(), least.data(), 2);
  for (const double value : least) EXPECT_LE(value, 1e-300);
}

TEST_P(CapKernelsOfSet, LargestPrincipalValueIsTheEigenvalue) {
  std::mt19937_64 generator(5);
  std::normal_distribution<double> normal;
  std::array<std::vector<double>, 6> tensors;
  std::vector<double> expected, size;
  const auto add = [&](const Eigen::Vector3d& values) {
    const Eigen::Matrix3d turn =
        Eigen::Quaterniond(normal(generator), normal(generator), normal(generator), normal(generator))
            .normalized()
            .toRotationMatrix();
    const Eigen::Matrix3d tensor = turn * values.asDiagonal() * turn.transpose();
    const double components[] = {tensor(0, 0), tensor(1, 1), tensor(2, 2), tensor(0, 1), tensor(1, 2), tensor(2, 0)};
    for (std::size_t c = 0; c < 6; ++c) tensors[c].push_back(components[c]);
    expected.push_back(values.maxCoeff());
    size.push_back(values.cwiseAbs().maxCoeff());
  };
  for (int i = 0; i < 30000; ++i) {
    const double scale = std::pow(10.0, 3.0 * normal(generator));
    const double a = normal(generator), b = normal(generator), c = normal(generator);
    add(scale * Eigen::Vector3d(a, b, c));
    add(scale * Eigen::Vector3d(a, a, b));                                  // double root, the larger or the smaller
    add(scale * Eigen::Vector3d(a, a * (1.0 + 1e-7 * b), c));               // nearly
    add(scale * Eigen::Vector3d(a, a, a));                                  // triple
    add(scale * (a + 1e-6 * Eigen::Vector3d(b, c, 0.0).array()).matrix());  // pressure above all
  }
  add({0.0, 0.0, 0.0});
  add({1e-45, -1e-45, 0.0});
  std::vector<double> result(expected.size());
  const double* pointers[6];
  for (std::size_t c = 0; c < 6; ++c) pointers[c] = tensors[c].data();
  kernels_.computeLargestPrincipal(pointers, result.data(), result.size());
  // A double root takes half of the digits of double; float, which strain and stress live in, has fewer.
  for (std::size_t i = 0; i < expected.size(); ++i) ASSERT_NEAR(result[i], expected[i], 2e-8 * size[i]) << i;
}

INSTANTIATE_TEST_SUITE_P(Available, CapKernelsOfSet, ::testing::ValuesIn(availableInstructionSets()),
                         [](const auto& info) { return nameOf(info.param); });

// ------------------------------------------------------------------------------------------------------------- update

struct Cloud {
  std::array<std::vector<float>, kComponents> strain, stress;
  std::vector<std::vector<float>> state;

  MaterialBatch batch() {
    MaterialBatch result;
    result.count = strain[0].size();
    for (std::size_t c = 0; c < kComponents; ++c) {
      result.strain_increment[c] = strain[c].data();
      result.stress[c] = stress[c].data();
    }
    for (std::vector<float>& values : state) result.state.push_back(values.data());
    return result;
  }
};

struct Case {
  std::string name;
  CapParameters parameters;
};

std::vector<Case> cases() {
  std::vector<Case> result;
  for (const double scale : {1e-3, 1.0}) {
    for (const double cohesion : {1.0, 300.0, 1e5}) {
      for (const FlowRule flow_rule : {FlowRule::kAssociated, FlowRule::kNonAssociated}) {
        for (const bool damages : {false, true}) {
          IceConfig ice;
          ice.cohesion_pa = cohesion;
          ice.flow_rule = flow_rule;
          ice.damage = damages;
          ice.gap_memory = damages;
          result.push_back({"scale " + std::to_string(scale) + ", cohesion " + std::to_string(cohesion) +
                                (damages ? ", damage" : "") +
                                (flow_rule == FlowRule::kAssociated ? "" : ", non-associated"),
                            makeCapParameters(ice, scale, 0.3)});
        }
      }
    }
  }
  IceConfig ice;
  ice.gap_memory = false;
  result.push_back({"damage without gap memory", makeCapParameters(ice, 1e-3, 0.3)});
  ice.damage = false;
  ice.gap_memory = true;
  result.push_back({"gap memory without damage", makeCapParameters(ice, 1e-3, 0.3)});
  ice.cap_hardening_quadratic_per_pa2 = 4.0e-9;  // large enough to matter, unlike that of Table 6
  result.push_back({"quadratic hardening", makeCapParameters(ice, 1e-3, 0.3)});
  ice.three_invariant = true;
  result.push_back({"three invariants", makeCapParameters(ice, 1e-3, 0.3)});
  return result;
}

/// States that a path leads to, and others near each corner of the surface, with strains from nothing to far beyond.
Cloud makeCloud(const CapModel& model, std::size_t count) {
  const CapParameters& p = model.parameters();
  std::mt19937_64 generator(11);
  std::normal_distribution<double> normal;
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
  };
  const std::vector<std::string> names = model.stateNames();
  Cloud cloud;
  for (auto& values : cloud.strain) values.resize(count);
  for (auto& values : cloud.stress) values.assign(count, 0.0f);
  cloud.state.assign(names.size(), std::vector<float>(count, 0.0f));
  const double yield_strain = p.alpha_pa / model.shearModulus();
  const auto setStrain = [&](double low, double high) {
    for (std::size_t n = 0; n < count; ++n) {
      const double size = yield_strain * std::pow(10.0, uniform(low, high)), mean = normal(generator);
      for (std::size_t c = 0; c < kComponents; ++c) {
        cloud.strain[c][n] = static_cast<float>(size * (normal(generator) + (c < 3 ? mean : 0.0)));
      }
    }
  };
  for (int i = 0; i < 6; ++i) {
    setStrain(-3.0, 1.0);
    MaterialBatch batch = cloud.batch();
    model.updateOneByOne(batch);
  }
  const auto state = [&](const char* name) {
    return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  };
  setStrain(-4.0, 2.0);
  for (std::size_t n = 0; n < count; ++n) {
    const double kind = uniform(0.0, 1.0);
    if (kind > 0.5) continue;
    // A compaction from none to beyond W, and a stress near apex, axis, neutral point, start or tip of that cap.
    const double compactions[] = {0.0, 1e-9, uniform(0.0, p.max_compaction), 0.99995 * p.max_compaction,
                                  2.0 * p.max_compaction};
    const double e = static_cast<double>(static_cast<float>(compactions[generator() % 5]));
    const double apex = -p.alpha_pa / p.theta, start = model.capStart(e), tip = model.capIntercept(e);
    const double inverse_ratio = 1.0 / p.aspect_ratio;
    const double neutral =
        2.0 * p.theta / (inverse_ratio + std::sqrt(inverse_ratio * inverse_ratio + 8.0 * p.theta * p.theta));
    const double places[] = {apex, 0.0, start, start + neutral * (tip - start), tip, uniform(apex, tip)};
    const double j1 = places[generator() % 6] + uniform(-1e-3, 1e-3) * p.alpha_pa;
    std::array<double, kComponents> d{};
    for (double& value : d) value = normal(generator);
    const double mean = (d[0] + d[1] + d[2]) / 3.0;
    for (std::size_t c = 0; c < 3; ++c) d[c] -= mean;
    const double size =
        std::sqrt(0.5 * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) + d[3] * d[3] + d[4] * d[4] + d[5] * d[5]);
    const double s = model.shearStrength(j1, e) * (generator() % 3 == 0 ? 0.0 : uniform(0.9, 1.1));
    // Each regime unmet, met, or broken to some degree.
    double damages[2] = {}, thresholds[2] = {};
    for (std::size_t i = 0; p.damages && i < 2; ++i) {
      const std::size_t degree = generator() % 3;
      if (degree > 0)
        thresholds[i] = p.alpha_pa / std::sqrt(model.shearModulus() / p.stiffness_scale) * uniform(0.0, 2.0);
      if (degree > 1) damages[i] = uniform(0.0, 0.999);
    }
    const double damage = generator() % 2 == 0 ? damages[1] : std::max(damages[0], damages[1]);
    for (std::size_t c = 0; c < kComponents; ++c) {
      cloud.stress[c][n] = static_cast<float>((1.0 - damage) * (s * d[c] / size - (c < 3 ? j1 / 3.0 : 0.0)));
    }
    cloud.state[0][n] = static_cast<float>(e);
    if (p.gap_memory) {
      cloud.state[state("gap")][n] = generator() % 2 == 0 ? 0.0f : static_cast<float>(yield_strain * uniform(0.0, 3.0));
    }
    if (p.damages) {
      cloud.state[state("damage")][n] = static_cast<float>(damage);
      cloud.state[state("brittle_damage")][n] = static_cast<float>(damages[0]);
      cloud.state[state("ductile_damage")][n] = static_cast<float>(damages[1]);
      cloud.state[state("brittle_threshold")][n] = static_cast<float>(thresholds[0]);
      cloud.state[state("ductile_threshold")][n] = static_cast<float>(thresholds[1]);
    }
    // From rest to a step that crushes all.
    const double sizes[] = {0.0, 1e-3, 1.0, 1e3, 0.1 / yield_strain};
    const float factor = static_cast<float>(sizes[generator() % 5]);
    for (std::size_t c = 0; c < kComponents; ++c) {
      cloud.strain[c][n] = factor == 0.0f ? 0.0f : factor * static_cast<float>(yield_strain * normal(generator));
    }
    // All around: s stays what it is.
    if (generator() % 4 == 0) {
      for (std::size_t c = 1; c < kComponents; ++c) cloud.strain[c][n] = c < 3 ? cloud.strain[0][n] : 0.0f;
    }
  }
  return cloud;
}

/// The first entry in which two arrays differ, or their size.
std::size_t firstDifference(const std::vector<float>& a, const std::vector<float>& b) {
  std::size_t i = 0;
  while (i < a.size() && std::memcmp(&a[i], &b[i], sizeof(float)) == 0) ++i;
  return i;
}

TEST(CapKernels, LanesDoWhatTheOneByOnePathDoes) {
  std::size_t total = 0, yielding = 0, breaking = 0;
  for (const Case& one : cases()) {
    SCOPED_TRACE(one.name);
    const CapModel model(one.parameters);
    const CapParameters& p = one.parameters;
    const std::size_t count = 5000;
    const Cloud before = makeCloud(model, count);
    Cloud lanes = before, expected = before;
    MaterialBatch batch = lanes.batch();
    model.update(batch);
    batch = expected.batch();
    model.updateOneByOne(batch);
    const std::vector<std::string> names = model.stateNames();
    for (std::size_t n = 0; n < count; ++n) {
      double old_size = 0.0, new_size = 0.0, strain_size = 0.0;
      for (std::size_t c = 0; c < kComponents; ++c) {
        old_size = std::max(old_size, static_cast<double>(std::abs(before.stress[c][n])));
        new_size = std::max(new_size, static_cast<double>(std::abs(expected.stress[c][n])));
        strain_size = std::max(strain_size, static_cast<double>(std::abs(before.strain[c][n])));
      }
      const bool yields = expected.state[1][n] != before.state[1][n] || expected.state[0][n] != before.state[0][n];
      // Float holds the stresses; the trial of a particle that yields is in double. Near the tip s goes with the root
      // of what J1 lacks to X, which the iterations leave open by 1e-14 of the trial's strain.
      const double trial_size = old_size + 3.0 * model.bulkModulus() * strain_size;
      const double e = static_cast<double>(expected.state[0][n]), intercept = model.capIntercept(e);
      const double hardening = 1e6 * (model.capIntercept(e + 1e-6) - intercept);
      const double shortfall = 1e-14 * 6.0 * strain_size * hardening / (intercept - model.capStart(e));  // of t
      const double tip = (p.alpha_pa + p.theta * intercept) * std::sqrt(2.0 * shortfall);
      const double tolerance =
          1e-6 * (p.alpha_pa + 3.0 * (old_size + new_size)) + (yields ? 1e-12 * trial_size + tip : 3e-7 * trial_size);
      for (std::size_t c = 0; c < kComponents; ++c) {
        ASSERT_NEAR(lanes.stress[c][n], expected.stress[c][n], tolerance) << "particle " << n << ", component " << c;
      }
      for (std::size_t i = 0; i < names.size(); ++i) {
        const double value = static_cast<double>(expected.state[i][n]);
        const bool is_damage = names[i].find("damage") != std::string::npos;
        const bool is_threshold = names[i].find("threshold") != std::string::npos;
        const double unit = is_damage      ? 1.0
                            : is_threshold ? tolerance / std::sqrt(model.shearModulus() / p.stiffness_scale)
                                           : tolerance / model.shearModulus();
        ASSERT_NEAR(lanes.state[i][n], value, 1e-6 * std::abs(value) + (is_damage ? 2e-6 : 1.0) * unit)
            << names[i] << " of particle " << n;
      }
      yielding += yields;
      breaking += p.damages && expected.state[p.gap_memory ? 3 : 2][n] > before.state[p.gap_memory ? 3 : 2][n];
      ++total;
    }
  }
  EXPECT_GE(total, 100000u);
  EXPECT_GT(yielding, total / 4);
  EXPECT_GT(breaking, total / 50);
}

TEST(CapKernels, EachInstructionSetGivesTheSameBits) {
  const std::vector<InstructionSet> sets = availableInstructionSets();
  for (const Case& one : cases()) {
    SCOPED_TRACE(one.name);
    const std::size_t count = 3011;
    const Cloud before = makeCloud(CapModel(one.parameters), count);
    std::vector<Cloud> results(sets.size(), before);
    for (std::size_t k = 0; k < sets.size(); ++k) {
      const CapModel model(one.parameters, sets[k]);
      MaterialBatch batch = results[k].batch();
      for (int i = 0; i < 3; ++i) model.update(batch);
      for (std::size_t c = 0; c < kComponents; ++c) {
        const std::size_t n = firstDifference(results[k].stress[c], results[0].stress[c]);
        ASSERT_EQ(n, count) << nameOf(sets[k]) << ", component " << c << ": " << results[k].stress[c][n] << " and "
                            << results[0].stress[c][n];
      }
      for (std::size_t i = 0; i < before.state.size(); ++i) {
        const std::size_t n = firstDifference(results[k].state[i], results[0].state[i]);
        ASSERT_EQ(n, count) << nameOf(sets[k]) << ", state " << i << ": " << results[k].state[i][n] << " and "
                            << results[0].state[i][n];
      }
    }
  }
}

}  // namespace
}  // namespace brash_ice_rig
