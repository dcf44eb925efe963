#include "brash_ice_rig/identify/candidate.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <memory>
#include <optional>

#include <Eigen/QR>

#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/effects/effect.h"
#include "brash_ice_rig/math/angle.h"

namespace brash_ice_rig {
namespace {

constexpr double kFallDurationS = 1.0;
constexpr double kTwoSided95 = 1.96;

/// Central 95 % of a prior.
std::pair<double, double> priorInterval(const Prior& prior) {
  switch (prior.kind) {
    case PriorKind::kUniform:
      return {prior.a + 0.025 * (prior.b - prior.a), prior.b - 0.025 * (prior.b - prior.a)};
    case PriorKind::kNormal:
      return {prior.a - kTwoSided95 * prior.b, prior.a + kTwoSided95 * prior.b};
    case PriorKind::kLogNormal:
      return {prior.a * std::exp(-kTwoSided95 * prior.b), prior.a * std::exp(kTwoSided95 * prior.b)};
    case PriorKind::kHalfNormal:
      return {0.0, kTwoSided95 * prior.b};
    case PriorKind::kNone:
      break;
  }
  return {0.0, 0.0};
}

Amplitude makeAmplitude(const EffectParameter& p) {
  Amplitude a;
  a.name = p.name;
  a.least = p.range.min;
  a.most = p.range.max;
  switch (p.prior.kind) {
    case PriorKind::kHalfNormal:
      a.prior_sigma = p.prior.b;
      a.positive = true;
      break;
    case PriorKind::kLogNormal:
      a.prior_mean = p.prior.a;
      a.prior_sigma = p.prior.a * p.prior.b;
      a.positive = true;
      break;
    case PriorKind::kUniform:
      a.prior_mean = 0.5 * (p.prior.a + p.prior.b);
      a.prior_sigma = (p.prior.b - p.prior.a) / std::sqrt(12.0);
      break;
    default:
      a.prior_mean = p.prior.a;
      a.prior_sigma = p.prior.b;
  }
  // Large against the scatter between arrangements of the blocks, within what is believed.
  a.step = std::clamp(std::max(a.prior_sigma, std::abs(a.prior_mean)), p.range.min, p.range.max);
  return a;
}

const EffectDescription& describedAs(const std::string& name) {
  const EffectDescription* const effect = findEffect(name);
  assert(effect != nullptr && "an effect of the library");
  return *effect;
}

const EffectParameter& parameterOf(const EffectDescription& effect, const std::string& name) {
  for (const EffectParameter& p : effect.parameters) {
    if (name == p.name) return p;
  }
  assert(false && "a parameter of the effect");
  return effect.parameters.front();
}

std::string keyOf(const EffectDescription& effect, const std::string& parameter) {
  return std::string("effects.") + effect.name + "." + parameter;
}

ParameterEstimate estimateOf(const EffectDescription& effect, const EffectParameter& p, double value, double sigma) {
  ParameterEstimate e;
  e.key = keyOf(effect, p.name);
  e.unit = p.unit;
  e.value = value;
  e.low = std::max(value - kTwoSided95 * sigma, p.range.min);
  e.high = std::min(value + kTwoSided95 * sigma, p.range.max);
  std::tie(e.prior_low, e.prior_high) = priorInterval(p.prior);
  return e;
}

double clampTo(const EffectParameter& p, double value) {
  return std::clamp(value, p.range.min, p.range.max);
}

/// Of an oscillation: its size and phase, with their standard deviations.
struct Phasor {
  double size, size_sigma, phase_deg, phase_sigma_deg;
};

/// @param parts  of sine and cosine
Phasor toPhasor(const Eigen::Vector2d& parts, const Eigen::Matrix2d& covariance) {
  const double size = parts.norm();
  const Eigen::Vector2d along = size > 0.0 ? Eigen::Vector2d(parts / size) : Eigen::Vector2d(1.0, 0.0);
  const Eigen::Vector2d across(-along.y(), along.x());
  return {size, std::sqrt(along.dot(covariance * along)), std::atan2(parts.y(), parts.x()) / kDegree,
          size > 0.0 ? std::sqrt(across.dot(covariance * across)) / size / kDegree : 180.0};
}

/// An effect with the amplitudes of the registry and some parameters given.
Variant makePlain(const EffectDescription& effect, const std::vector<const EffectParameter*>& amplitudes,
                  const std::vector<std::pair<std::string, double>>& given) {
  Variant v;
  v.effect = &effect;
  for (const auto& [name, value] : given) {
    v.label += (v.label.empty() ? "" : ", ") + name + " = " + formatNumber(value);
  }
  for (const EffectParameter* p : amplitudes) v.amplitudes.push_back(makeAmplitude(*p));
  v.apply = [&effect, amplitudes, given](EffectValues& values, const Eigen::VectorXd& a) {
    values.enabled = true;
    for (const EffectParameter& p : effect.parameters) {
      if (p.role == ParameterRole::kAmplitude) values.set(p.name, 0.0);
    }
    for (const auto& [name, value] : given) values.set(name, value);
    for (std::size_t k = 0; k < amplitudes.size(); ++k) {
      values.set(amplitudes[k]->name, clampTo(*amplitudes[k], a[static_cast<Eigen::Index>(k)]));
    }
  };
  v.estimate = [&effect, amplitudes](const Eigen::VectorXd& a, const Eigen::MatrixXd& covariance) {
    std::vector<ParameterEstimate> estimates;
    for (std::size_t k = 0; k < amplitudes.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      estimates.push_back(estimateOf(effect, *amplitudes[k], a[i], std::sqrt(covariance(i, i))));
    }
    return estimates;
  };
  return v;
}

}  // namespace

std::vector<Variant> makeVariants(const EffectDescription& effect, PositionOrigin position) {
  const std::string name = effect.name;
  if (name == "block_drop" || name == "vessel_heave") return {};
  if (name == "crane_speed" && position == PositionOrigin::kMeasured) return {};

  // Amplitudes that the defaults have switched on belong together; each that they leave at zero is tried alone.
  std::vector<std::vector<const EffectParameter*>> groups(1);
  for (const EffectParameter& p : effect.parameters) {
    if (p.role != ParameterRole::kAmplitude || p.prior.kind == PriorKind::kNone) continue;
    if (p.default_value != 0.0) {
      groups.front().push_back(&p);
    } else {
      groups.push_back({&p});
    }
  }
  std::vector<std::vector<std::pair<std::string, double>>> shapes{{}};
  for (const EffectParameter& p : effect.parameters) {
    if (p.tried) {
      shapes.clear();
      for (const double deviations : {-1.0, 0.0, 1.0}) {
        shapes.push_back({{p.name, clampTo(p, p.prior.a * std::exp(deviations * p.prior.b))}});
      }
    }
    if (p.kind == EffectParameter::Kind::kWhole && std::string(p.name) == "seed") {
      std::vector<std::vector<std::pair<std::string, double>>> seeded;
      for (const double seed : {1.0, 2.0, 3.0}) {
        seeded.push_back(shapes[shapes.size() / 2]);
        seeded.back().emplace_back(p.name, seed);
      }
      shapes = seeded;
    }
  }
  std::vector<Variant> variants;
  for (const auto& group : groups) {
    if (group.empty()) continue;
    for (const auto& shape : shapes) variants.push_back(makePlain(effect, group, shape));
  }
  return variants;
}

Variant makeFalls(const std::vector<double>& times_s) {
  assert(!times_s.empty() && times_s.size() <= 3);
  const EffectDescription& effect = describedAs("block_drop");
  Variant v;
  v.effect = &effect;
  const auto named = [](const char* stem, std::size_t k, const char* unit) {
    return std::string(stem) + "_" + std::to_string(k + 1) + "_" + unit;
  };
  for (std::size_t k = 0; k < times_s.size(); ++k) {
    v.label += (k == 0 ? "at " : " and ") + formatNumber(times_s[k]) + " s";
    v.amplitudes.push_back(makeAmplitude(parameterOf(effect, named("mass", k, "kg"))));
    v.amplitudes.back().once = true;
  }
  v.apply = [times_s, named, &effect](EffectValues& values, const Eigen::VectorXd& a) {
    values.enabled = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const bool used = k < times_s.size();
      const double mass = used ? a[static_cast<Eigen::Index>(k)] : 0.0;
      values.set(named("mass", k, "kg"), clampTo(parameterOf(effect, named("mass", k, "kg")), mass));
      if (!used) continue;
      values.set(named("time", k, "s"), times_s[k]);
      values.set(named("duration", k, "s"), kFallDurationS);
    }
  };
  v.estimate = [times_s, named, &effect](const Eigen::VectorXd& a, const Eigen::MatrixXd& covariance) {
    std::vector<ParameterEstimate> estimates;
    for (std::size_t k = 0; k < times_s.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      estimates.push_back(
          estimateOf(effect, parameterOf(effect, named("mass", k, "kg")), a[i], std::sqrt(covariance(i, i))));
      // The time is known to the grid on which it was looked for.
      estimates.push_back(estimateOf(effect, parameterOf(effect, named("time", k, "s")), times_s[k], 0.5));
    }
    return estimates;
  };
  return v;
}

Variant makeSwell(const std::vector<double>& periods_s, bool hangs_clear) {
  assert(!periods_s.empty() && periods_s.size() <= 3);
  const EffectDescription& effect = describedAs("vessel_heave");
  Variant v;
  v.effect = &effect;
  v.periods_s = periods_s;
  v.hangs_clear = hangs_clear;
  const auto named = [](const char* stem, std::size_t k, const char* unit) {
    return std::string(stem) + "_" + std::to_string(k + 1) + "_" + unit;
  };
  for (std::size_t k = 0; k < periods_s.size(); ++k) {
    v.label += (k == 0 ? "period " : " and ") + formatNumber(periods_s[k]) + " s";
    for (const char* part : {"sine", "cosine"}) {
      Amplitude a = makeAmplitude(parameterOf(effect, named("amplitude", k, "m")));
      a.name += std::string(" (") + part + ")";
      a.positive = false;
      a.least = -a.most;
      a.swing = static_cast<int>(k) + 1;
      v.amplitudes.push_back(a);
    }
  }
  v.apply = [periods_s, named, &effect](EffectValues& values, const Eigen::VectorXd& a) {
    values.enabled = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const bool used = k < periods_s.size();
      const auto i = static_cast<Eigen::Index>(2 * k);
      const double size = used ? std::hypot(a[i], a[i + 1]) : 0.0;
      values.set(named("amplitude", k, "m"), clampTo(parameterOf(effect, named("amplitude", k, "m")), size));
      if (!used) continue;
      values.set(named("period", k, "s"), periods_s[k]);
      values.set(named("phase", k, "deg"), std::atan2(a[i + 1], a[i]) / kDegree);
    }
  };
  v.estimate = [periods_s, named, &effect](const Eigen::VectorXd& a, const Eigen::MatrixXd& covariance) {
    std::vector<ParameterEstimate> estimates;
    for (std::size_t k = 0; k < periods_s.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(2 * k);
      const Phasor swell = toPhasor(a.segment<2>(i), covariance.block<2, 2>(i, i));
      estimates.push_back(
          estimateOf(effect, parameterOf(effect, named("amplitude", k, "m")), swell.size, swell.size_sigma));
      estimates.push_back(
          estimateOf(effect, parameterOf(effect, named("period", k, "s")), periods_s[k], 0.05 * periods_s[k]));
      estimates.push_back(
          estimateOf(effect, parameterOf(effect, named("phase", k, "deg")), swell.phase_deg, swell.phase_sigma_deg));
    }
    return estimates;
  };
  return v;
}

namespace {

/// pole_tilt along a direction.
/// @param drifts    with steady speed as the first amplitude
/// @param swings    amplitudes of the sway: none, its sine, or its sine and cosine
/// @param period_s  of the sway, if there is one
Variant makeTilt(double lean_ratio, double direction_deg, bool drifts, Eigen::Index swings, double period_s) {
  const EffectDescription& effect = describedAs("pole_tilt");
  const EffectParameter &drift = parameterOf(effect, "drift_mps"), &sway = parameterOf(effect, "sway_m"),
                        &phase = parameterOf(effect, "sway_phase_deg");
  constexpr double kDirectionSigmaDeg = 10.0;
  Variant v;
  v.effect = &effect;
  v.label = "direction_deg = " + formatNumber(direction_deg) + ", lean_ratio = " + formatNumber(lean_ratio);
  if (swings > 0) v.label += ", sway_period_s = " + formatNumber(period_s) + (drifts ? " and drift" : "");
  const auto add = [&v](const EffectParameter& parameter, const char* part, int swing) {
    Amplitude a = makeAmplitude(parameter);
    a.name += part;
    a.positive = false;
    a.least = -a.most;
    a.swing = swing;
    v.amplitudes.push_back(a);
  };
  if (drifts) add(drift, "", 0);
  if (swings > 0) add(sway, " (sine)", 1);
  if (swings > 1) add(sway, " (cosine)", 1);
  const Eigen::Index first = drifts ? 1 : 0;
  const auto swayOf = [=](const Eigen::VectorXd& a) {
    return Eigen::Vector2d(swings > 0 ? a[first] : 0.0, swings > 1 ? a[first + 1] : 0.0);
  };
  v.apply = [=, &drift, &sway](EffectValues& values, const Eigen::VectorXd& a) {
    values.enabled = true;
    values.set("lean_ratio", lean_ratio);
    values.set("direction_deg", direction_deg);
    values.set("drift_mps", drifts ? clampTo(drift, a[0]) : 0.0);
    const Eigen::Vector2d swaying = swayOf(a);
    values.set("sway_m", clampTo(sway, swaying.norm()));
    // Without sway its period would only make another scenario of the same lift.
    if (swaying.isZero(0.0)) return;
    values.set("sway_period_s", period_s);
    values.set("sway_phase_deg", std::atan2(swaying.y(), swaying.x()) / kDegree);
  };
  v.estimate = [=, &effect, &drift, &sway, &phase](const Eigen::VectorXd& a, const Eigen::MatrixXd& covariance) {
    std::vector<ParameterEstimate> estimates;
    if (drifts) estimates.push_back(estimateOf(effect, drift, a[0], std::sqrt(covariance(0, 0))));
    if (swings > 0) {
      Eigen::Matrix2d c = Eigen::Matrix2d::Zero();
      c.topLeftCorner(swings, swings) = covariance.block(first, first, swings, swings);
      const Phasor swaying = toPhasor(swayOf(a), c);
      estimates.push_back(estimateOf(effect, sway, swaying.size, swaying.size_sigma));
      // A sine alone has one of two phases, and no error.
      if (swings == 2) estimates.push_back(estimateOf(effect, phase, swaying.phase_deg, swaying.phase_sigma_deg));
    }
    estimates.push_back(estimateOf(effect, parameterOf(effect, "direction_deg"), direction_deg, kDirectionSigmaDeg));
    return estimates;
  };
  return v;
}

const EffectParameter& swayPeriod() {
  return parameterOf(describedAs("pole_tilt"), "sway_period_s");
}

}  // namespace

std::vector<Variant> makeUprightTilts(double direction_deg) {
  constexpr double kUpright = 0.0;
  const double usual_s = clampTo(swayPeriod(), swayPeriod().prior.a);
  return {makeTilt(kUpright, direction_deg, true, 0, usual_s), makeTilt(kUpright, direction_deg, false, 1, usual_s)};
}

std::vector<Variant> makeLeaningTilts(double direction_deg, double pole_length_m, const Eigen::VectorXd& time_s,
                                      const Eigen::VectorXd& tension_n, const Eigen::VectorXd& along_n) {
  assert(time_s.size() == tension_n.size() && time_s.size() == along_n.size());
  // Where the cell carries little, noise would pass for a lean.
  constexpr double kLeastShare = 0.2;
  const Eigen::ArrayXd lifting_s = time_s.array().max(0.0), per_metre_n = -tension_n.array() / pole_length_m;
  const Eigen::ArrayXd counts =
      (time_s.array() >= 0.0 && tension_n.array() >= kLeastShare * tension_n.maxCoeff()).cast<double>();
  std::vector<Variant> variants;
  const auto add = [&](bool drifts, Eigen::Index swings, double period_s) {
    Variant v = makeTilt(1.0, direction_deg, drifts, swings, period_s);
    const auto count = static_cast<Eigen::Index>(v.amplitudes.size());
    Eigen::MatrixXd way_per_unit(time_s.size(), count);
    const Eigen::ArrayXd angle = lifting_s * (2.0 * kPi / period_s);
    if (drifts) way_per_unit.col(0) = lifting_s;
    if (swings > 0) way_per_unit.col(count - 2) = angle.sin();
    if (swings > 0) way_per_unit.col(count - 1) = angle.cos() - 1.0;
    v.lateral_n = way_per_unit.array().colwise() * per_metre_n;
    // What the way does to the vertical force is the same to both sides, and scatters as much for a small one.
    const Eigen::VectorXd fitted = (way_per_unit.array().colwise() * counts)
                                       .matrix()
                                       .colPivHouseholderQr()
                                       .solve((counts * along_n.array() / per_metre_n).matrix());
    for (Eigen::Index k = 0; k < count; ++k) {
      Amplitude& a = v.amplitudes[static_cast<std::size_t>(k)];
      a.step = std::copysign(std::clamp(std::abs(fitted[k]), a.step, a.most), fitted[k]);
    }
    variants.push_back(std::move(v));
  };
  const EffectParameter& period = swayPeriod();
  add(true, 0, period.prior.a);
  // A pole that is pushed aside and comes part of the way back is slower than the lift.
  for (const double deviations : {-1.0, 0.0, 1.0, 2.0}) {
    const double period_s = clampTo(period, period.prior.a * std::exp(deviations * period.prior.b));
    // A lean is seen by where the foot is, which one may know to a centimetre: worth a cosine.
    add(false, 2, period_s);
    if (deviations > 0.0) add(true, 2, period_s);
  }
  return variants;
}

Eigen::VectorXd fallTemplate(double time_s, const Eigen::VectorXd& bin_time_s) {
  return -kGravityMps2 * ((bin_time_s.array() - time_s) / kFallDurationS).max(0.0).min(1.0).matrix();
}

Eigen::MatrixXd swellResponse(const Eigen::MatrixXd& simulated, double simulated_period_s, double period_s,
                              const Eigen::VectorXd& time_s, const Eigen::VectorXd& mass_kg) {
  assert(simulated.cols() == 2 && simulated.rows() == time_s.size() && mass_kg.size() == time_s.size());
  const double pitch = 2.0 * kPi / period_s, simulated_pitch = 2.0 * kPi / simulated_period_s;
  Eigen::MatrixXd columns(simulated.rows(), 2);
  for (Eigen::Index i = 0; i < columns.rows(); ++i) {
    // sin(p' t) = sin(p t) cos((p' - p) t) + cos(p t) sin((p' - p) t), and the force answers to the swell of that
    // moment. Its inertia grows with the square of the pitch.
    const double time = time_s[i], turned = (pitch - simulated_pitch) * time;
    const double sine = std::sin(turned), cosine = std::cos(turned);
    const double inertia = -mass_kg[i] * (pitch * pitch - simulated_pitch * simulated_pitch);
    columns(i, 0) = simulated(i, 0) * cosine + simulated(i, 1) * sine + inertia * std::sin(pitch * time);
    columns(i, 1) = simulated(i, 1) * cosine - simulated(i, 0) * sine + inertia * std::cos(pitch * time);
  }
  return columns;
}

SimulatedForce throughLoadCell(const EffectValues& values, const Scenario& scenario, const SimulatedForce& force) {
  assert(values.description().reading_only && values.enabled);
  SimulatedForce read = force;
  const double dt = force.time_s.size() > 1 ? force.time_s[1] - force.time_s[0] : 1.0;
  for (std::vector<double>* reading : {&read.force_n, &read.empty_force_n}) {
    const std::unique_ptr<Effect> effect = values.description().make(values, scenario);
    for (std::size_t i = 0; i < reading->size(); ++i) {
      Eigen::Vector3d now(0.0, 0.0, (*reading)[i]);
      effect->updateReading(force.time_s[i], dt, now);
      (*reading)[i] = now.z();
    }
  }
  return read;
}

}  // namespace brash_ice_rig
