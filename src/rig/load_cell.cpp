#include "brash_ice_rig/rig/load_cell.h"

#include <cmath>
#include <locale>
#include <sstream>
#include <string>

#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {
namespace {

/// Checks one value against the range of the key that it is for.
struct KeyCheck {
  const std::string& name;
  double value;

  template <class Number>
  void operator()(const char* key, const Number&, const Range& range, const char*) const {
    if (key == name) checkRange("load_cell." + name, value, formatNumber(value), range);
  }
};

}  // namespace

void checkLoadCellKey(const std::string& name, double value) {
  LoadCellConfig config;
  KeyCheck check{name, value};
  config.visit(check);
}

LoadCell::LoadCell(const LoadCellConfig& config) : config_(config), generator_(config.seed) {}

void LoadCell::step(double time_step_s, const Eigen::Vector3d& force_n) {
  if (!started_ || config_.lag_s == 0.0) {
    lagged_ = force_n;
    started_ = true;
    return;
  }
  // Exact response over the step to a force that stays constant in it; stable for any lag.
  lagged_ += (1.0 - repeatable::exp(-time_step_s / config_.lag_s)) * (force_n - lagged_);
}

void LoadCell::sample() {
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    double value = lagged_[axis] + config_.bias_n;
    if (config_.noise_n > 0.0) value += config_.noise_n * repeatable::normal(generator_);
    // Not by dividing: the quotient overflows for a tiny resolution.
    if (config_.resolution_n > 0.0) value -= std::remainder(value, config_.resolution_n);
    reading_[axis] = value - tare_[axis];
  }
}

void LoadCell::tare() {
  tare_ = lagged_.array() + config_.bias_n;
}

void LoadCell::visitState(StateVisitor& visitor) {
  // The only form in which the library hands out the state of its generators; it is exact.
  std::stringstream stream;
  stream.imbue(std::locale::classic());
  stream << generator_;
  std::string text = stream.str();
  visitor("generator", text);
  if (visitor.loading()) {
    stream.clear();
    stream.str(text);
    if (!(stream >> generator_)) visitor.refuse("the state of the load cell's noise cannot be read");
  }
  visitor("noise_n", config_.noise_n);
  visitor("resolution_n", config_.resolution_n);
  visitor("started", started_);
  visitor("lagged_n", lagged_);
  visitor("reading_n", reading_);
  visitor("tare_n", tare_);
}

}  // namespace brash_ice_rig
