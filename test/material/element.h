#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

#include "brash_ice_rig/material/material.h"

namespace brash_ice_rig {

/// One material point under prescribed strain: the smallest test rig for a constitutive law.
class Element {
 public:
  explicit Element(const Material& material) : material_(&material), state_(material.stateNames().size(), 0.0f) {}

  /// Applies a strain increment (xx, yy, zz, xy, yz, zx; tension positive).
  void strain(const std::array<double, kComponents>& increment) {
    std::array<float, kComponents> strain{};
    for (std::size_t c = 0; c < kComponents; ++c) strain[c] = static_cast<float>(increment[c]);
    MaterialBatch batch;
    batch.count = 1;
    for (std::size_t c = 0; c < kComponents; ++c) {
      batch.strain_increment[c] = &strain[c];
      batch.stress[c] = &stress_[c];
    }
    for (float& value : state_) batch.state.push_back(&value);
    material_->update(batch);
  }

  /// Strains along z and keeps the stress on x and y at a given value, as a triaxial cell does (secant iteration on
  /// the lateral strain).
  void strainAxially(double axial_increment, double lateral_stress_pa) {
    const Element start = *this;
    const auto attempt = [&](double lateral) {
      *this = start;
      strain({lateral, lateral, axial_increment, 0.0, 0.0, 0.0});
      return stress(0) - lateral_stress_pa;
    };
    double lateral_0 = lateral_guess_, lateral_1 = lateral_guess_ + 0.1 * std::abs(axial_increment);
    double error_0 = attempt(lateral_0), error_1 = attempt(lateral_1);
    const double tolerance = 2e-6 * (std::abs(lateral_stress_pa) + std::abs(start.stress(2)) + 1.0);
    for (int i = 0; i < 50 && std::abs(error_1) > tolerance; ++i) {
      if (error_1 == error_0) break;
      const double next = lateral_1 - error_1 * (lateral_1 - lateral_0) / (error_1 - error_0);
      lateral_0 = lateral_1;
      error_0 = error_1;
      lateral_1 = next;
      error_1 = attempt(lateral_1);
    }
    if (!(std::abs(error_1) <= tolerance)) throw std::runtime_error("the triaxial cell lost its lateral stress");
    lateral_guess_ = lateral_1;
  }

  double stress(std::size_t component) const { return static_cast<double>(stress_[component]); }
  void setStress(const std::array<double, kComponents>& stress_pa) {
    for (std::size_t c = 0; c < kComponents; ++c) stress_[c] = static_cast<float>(stress_pa[c]);
  }
  double state(const std::string& name) const { return static_cast<double>(state_[indexOf(name)]); }
  void setState(const std::string& name, double value) { state_[indexOf(name)] = static_cast<float>(value); }

  /// -tr(stress), Pa.
  double j1() const { return -(stress(0) + stress(1) + stress(2)); }
  /// sqrt(J2'), Pa.
  double s() const {
    const double mean = -j1() / 3.0;
    double sum = 0.0;
    for (std::size_t c = 0; c < 3; ++c) sum += 0.5 * (stress(c) - mean) * (stress(c) - mean);
    for (std::size_t c = 3; c < kComponents; ++c) sum += stress(c) * stress(c);
    return std::sqrt(sum);
  }

 private:
  std::size_t indexOf(const std::string& name) const {
    const std::vector<std::string> names = material_->stateNames();
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) throw std::runtime_error("no state " + name);
    return static_cast<std::size_t>(found - names.begin());
  }

  const Material* material_;
  std::array<float, kComponents> stress_{};
  std::vector<float> state_;
  double lateral_guess_ = 0.0;
};

}  // namespace brash_ice_rig
