#include <cmath>

#include "brash_ice_rig/effects/effect.h"

#include "brash_ice_rig/math/repeatable.h"

// Four errors of the sensor. Together they make of a force F(t) the signal (1 + scale) F_lagged(t) + drift t + bias.

namespace brash_ice_rig {
namespace {

/// tau dF_lagged/dt = F - F_lagged, along all axes.
class LoadCellLag : public Effect {
 public:
  explicit LoadCellLag(double lag_s) : lag_s_(lag_s) {}

  void updateReading(double /*time_s*/, double time_step_s, Eigen::Vector3d& force_n) override {
    if (lag_s_ == 0.0) return;
    Eigen::Map<Eigen::Vector3d> lagged(lagged_n_.data());
    // Exact response over the step to a force that stays constant in it.
    const double share = started_ == 0.0 ? 1.0 : 1.0 - repeatable::exp(-time_step_s / lag_s_);
    lagged += share * (force_n - lagged);
    started_ = 1.0;
    force_n = lagged;
  }

  void visitState(StateVisitor& visitor) override {
    visitor("started", started_);
    visitor("lagged_n", lagged_n_);
  }

 private:
  double lag_s_;
  double started_ = 0.0;
  std::vector<double> lagged_n_ = std::vector<double>(3, 0.0);
};

class LoadCellScale : public Effect {
 public:
  explicit LoadCellScale(double error_ratio) : error_ratio_(error_ratio) {}
  void updateReading(double /*time_s*/, double /*time_step_s*/, Eigen::Vector3d& force_n) override {
    force_n *= 1.0 + error_ratio_;
  }

 private:
  double error_ratio_;
};

class LoadCellDrift : public Effect {
 public:
  explicit LoadCellDrift(double rate_n_per_min) : rate_n_per_s_(rate_n_per_min / 60.0) {}
  void updateReading(double time_s, double /*time_step_s*/, Eigen::Vector3d& force_n) override {
    if (time_s > 0.0) force_n.z() += rate_n_per_s_ * time_s;
  }

 private:
  double rate_n_per_s_;
};

class LoadCellBias : public Effect {
 public:
  explicit LoadCellBias(double bias_n) : bias_n_(bias_n) {}
  void updateReading(double /*time_s*/, double /*time_step_s*/, Eigen::Vector3d& force_n) override {
    force_n.z() += bias_n_;
  }

 private:
  double bias_n_;
};

EffectDescription describeSensor() {
  EffectDescription d;
  d.reading_only = true;
  d.in_energy_balance = true;
  return d;
}

}  // namespace

EffectDescription describeLoadCellLag() {
  EffectDescription d = describeSensor();
  d.name = "load_cell_lag";
  d.mechanism = "the load cell follows the force with a first-order lag";
  d.parameters = {amplitude("lag_s", "s", 0.5, {0.0, 60.0}, {PriorKind::kHalfNormal, 0.0, 0.5}, true,
                            "time constant tau; 63 % of a step is seen after it")};
  d.confusable_with = {"crane_speed", "compliance"};
  d.how_to_tell = "a lift with a stop: only lag keeps the reading moving after the crane stands";
  d.make = [](const EffectValues& v, const Scenario&) { return std::make_unique<LoadCellLag>(v["lag_s"]); };
  return d;
}

EffectDescription describeLoadCellScale() {
  EffectDescription d = describeSensor();
  d.name = "load_cell_scale";
  d.mechanism = "the load cell's calibration factor is off";
  d.parameters = {amplitude("error_ratio", "1", 0.05, {-0.5, 0.5}, {PriorKind::kNormal, 0.0, 0.05}, true,
                            "the reading is (1 + this) times the force")};
  d.confusable_with = {"load_cell_bias"};
  d.how_to_tell = "known weights on the hook, or a lift without ice";
  d.make = [](const EffectValues& v, const Scenario&) { return std::make_unique<LoadCellScale>(v["error_ratio"]); };
  return d;
}

EffectDescription describeLoadCellDrift() {
  EffectDescription d = describeSensor();
  d.name = "load_cell_drift";
  d.mechanism = "the load cell's zero wanders steadily from time 0 on";
  d.parameters = {amplitude("rate_n_per_min", "N/min", 200.0, {-1.0e5, 1.0e5}, {PriorKind::kNormal, 0.0, 200.0}, true,
                            "change of the reading per minute")};
  d.confusable_with = {"drainage", "load_cell_bias"};
  d.how_to_tell = "a lift without ice, or the reading of the hanging rig before and after the test";
  d.make = [](const EffectValues& v, const Scenario&) { return std::make_unique<LoadCellDrift>(v["rate_n_per_min"]); };
  return d;
}

EffectDescription describeLoadCellBias() {
  EffectDescription d = describeSensor();
  d.name = "load_cell_bias";
  d.mechanism = "the load cell's zero is off";
  d.parameters = {amplitude("bias_n", "N", 200.0, {-1.0e5, 1.0e5}, {PriorKind::kNormal, 0.0, 200.0}, true,
                            "added to the reading; taring removes it")};
  d.confusable_with = {"load_cell_scale"};
  d.how_to_tell = "a lift without ice";
  d.make = [](const EffectValues& v, const Scenario&) { return std::make_unique<LoadCellBias>(v["bias_n"]); };
  return d;
}

}  // namespace brash_ice_rig
