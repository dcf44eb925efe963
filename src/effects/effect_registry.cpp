#include "brash_ice_rig/effects/effect_registry.h"

#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/effects/effect.h"

namespace brash_ice_rig {

// The effects of the library, one line each, in the order in which they act. Each is described in src/effects/, by a
// function describe<Name>(). What moves the suspension point comes before the rope under it; in the load cell, lag and
// scale come before what is added to their result.
#define BRASH_ICE_FOR_EACH_EFFECT(X) \
  X(PorosityGradient)                \
  X(ThicknessField)                  \
  X(FreezeBonds)                     \
  X(Refreezing)                      \
  X(RateDependence)                  \
  X(Drainage)                        \
  X(BlockDrop)                       \
  X(CraneSpeed)                      \
  X(VesselHeave)                     \
  X(PoleTilt)                        \
  X(CollectorHydrodynamics)          \
  X(Compliance)                      \
  X(LoadCellLag)                     \
  X(LoadCellScale)                   \
  X(LoadCellDrift)                   \
  X(LoadCellBias)

#define BRASH_ICE_DECLARE(Name) EffectDescription describe##Name();
BRASH_ICE_FOR_EACH_EFFECT(BRASH_ICE_DECLARE)
#undef BRASH_ICE_DECLARE

namespace {

std::deque<EffectDescription>& registry() {
#define BRASH_ICE_LIST(Name) describe##Name(),
  static std::deque<EffectDescription> effects = {BRASH_ICE_FOR_EACH_EFFECT(BRASH_ICE_LIST)};
#undef BRASH_ICE_LIST
  return effects;
}

/// An effect that may be half a lift off says nothing of when.
constexpr double kMaxTimingSigma = 10.0;

/// Whether a prior is one, and has its weight within the range: a centre, or two deviations where 0 is the centre.
bool isProper(const Prior& prior, const Range& range) {
  switch (prior.kind) {
    case PriorKind::kNone:
      return true;
    case PriorKind::kUniform:
      return range.contains(prior.a) && range.contains(prior.b) && prior.a < prior.b;
    case PriorKind::kNormal:
      return range.contains(prior.a) && prior.b > 0.0;
    case PriorKind::kLogNormal:
      return range.contains(prior.a) && prior.a > 0.0 && prior.b > 0.0;
    case PriorKind::kHalfNormal:
      return prior.a == 0.0 && prior.b > 0.0 && range.contains(2.0 * prior.b);
  }
  return false;
}

}  // namespace

const char* priorName(PriorKind kind) {
  switch (kind) {
    case PriorKind::kNone:
      return "none";
    case PriorKind::kUniform:
      return "uniform";
    case PriorKind::kNormal:
      return "normal";
    case PriorKind::kLogNormal:
      return "log_normal";
    case PriorKind::kHalfNormal:
      return "half_normal";
  }
  return "unknown";
}

EffectParameter amplitude(const char* name, const char* unit, double default_value, const Range& range,
                          const Prior& prior, bool linear, const char* text) {
  EffectParameter p = shape(name, unit, default_value, range, prior, text);
  p.role = ParameterRole::kAmplitude;
  p.linear = linear;
  return p;
}

EffectParameter shape(const char* name, const char* unit, double default_value, const Range& range, const Prior& prior,
                      const char* text) {
  EffectParameter p = setting(name, unit, default_value, range, text);
  p.role = ParameterRole::kShape;
  p.prior = prior;
  return p;
}

EffectParameter triedShape(const char* name, const char* unit, double default_value, const Range& range,
                           const Prior& prior, const char* text) {
  EffectParameter p = shape(name, unit, default_value, range, prior, text);
  p.tried = true;
  return p;
}

EffectParameter setting(const char* name, const char* unit, double default_value, const Range& range,
                        const char* text) {
  EffectParameter p;
  p.name = name;
  p.unit = unit;
  p.default_value = default_value;
  p.range = range;
  p.text = text;
  return p;
}

EffectParameter wholeSetting(const char* name, double default_value, const Range& range, const char* text) {
  EffectParameter p = setting(name, "1", default_value, range, text);
  p.kind = EffectParameter::Kind::kWhole;
  return p;
}

EffectParameter switchSetting(const char* name, bool default_value, const char* text) {
  EffectParameter p = setting(name, "", default_value ? 1.0 : 0.0, Range{0.0, 1.0}, text);
  p.kind = EffectParameter::Kind::kSwitch;
  return p;
}

const std::deque<EffectDescription>& effectRegistry() {
  return registry();
}

const EffectDescription* findEffect(const std::string& name) {
  for (const EffectDescription& effect : registry()) {
    if (name == effect.name) return &effect;
  }
  return nullptr;
}

void checkDescription(const EffectDescription& description) {
  const std::string name = description.name;
  const auto require = [&](bool kept, const std::string& rule) {
    if (!kept) throw std::invalid_argument("effect " + name + ": " + rule);
  };
  if (name.empty() || name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") != std::string::npos) {
    throw std::invalid_argument("effect name `" + name + "` must be made of a-z, 0-9 and _");
  }
  require(static_cast<bool>(description.make), "it has no `make`");
  require(Range{0.0, kMaxTimingSigma}.contains(description.timing_sigma_s),
          "timing_sigma_s must lie in [0, " + formatNumber(kMaxTimingSigma) + "], is " +
              formatNumber(description.timing_sigma_s));
  std::set<std::string> names;
  int tried = 0;
  for (const EffectParameter& p : description.parameters) {
    const std::string key = p.name;
    require(names.insert(key).second, key + " is there twice");
    require(p.range.contains(p.default_value),
            "default of " + key + " must lie in " + formatRange(p.range) + ", is " + formatNumber(p.default_value));
    require(p.role != ParameterRole::kAmplitude || p.range.contains(0.0),
            key + " is an amplitude, its range must hold 0, which is off");
    require((p.prior.kind == PriorKind::kNone) == (p.role == ParameterRole::kSetting),
            key + (p.role == ParameterRole::kSetting ? " is a setting, it has no prior" : " needs a prior"));
    require(isProper(p.prior, p.range), "prior of " + key + ", " + priorName(p.prior.kind) + "(" +
                                            formatNumber(p.prior.a) + ", " + formatNumber(p.prior.b) +
                                            "), does not fit its range " + formatRange(p.range));
    if (!p.tried) continue;
    require(p.prior.kind == PriorKind::kLogNormal, key + " is tried, its prior must be log-normal");
    require(++tried == 1, key + " is the second shape to be tried");
  }
}

void registerEffect(EffectDescription description) {
  checkDescription(description);
  if (findEffect(description.name) != nullptr) {
    throw std::invalid_argument(std::string("there is an effect ") + description.name + " already");
  }
  registry().push_back(std::move(description));
}

EffectValues::EffectValues(const EffectDescription& description) : description_(&description) {
  for (const EffectParameter& p : description.parameters) {
    Value value;
    value.number = p.default_value;
    values_.push_back(value);
    set(p.name, p.default_value);
  }
}

std::size_t EffectValues::indexOf(const std::string& name) const {
  for (std::size_t i = 0; i < values_.size(); ++i) {
    if (name == description_->parameters[i].name) return i;
  }
  throw std::out_of_range(std::string("effect ") + description_->name + " has no parameter " + name);
}

double EffectValues::operator[](const std::string& name) const {
  const std::size_t i = indexOf(name);
  switch (description_->parameters[i].kind) {
    case EffectParameter::Kind::kWhole:
      return static_cast<double>(values_[i].whole);
    case EffectParameter::Kind::kSwitch:
      return values_[i].on ? 1.0 : 0.0;
    case EffectParameter::Kind::kNumber:
      break;
  }
  return values_[i].number;
}

void EffectValues::set(const std::string& name, double value) {
  const std::size_t i = indexOf(name);
  values_[i].number = value;
  values_[i].whole = value >= 0.0 ? static_cast<std::uint64_t>(value) : 0;
  values_[i].on = value != 0.0;
}

EffectsConfig::EffectsConfig() {
  for (const EffectDescription& description : registry()) effects_.emplace_back(description);
}

EffectValues& EffectsConfig::operator[](const std::string& name) {
  for (EffectValues& effect : effects_) {
    if (name == effect.description().name) return effect;
  }
  throw std::out_of_range("there is no effect " + name);
}

Fade computeFade(double u) {
  if (u <= 0.0) return {0.0, 0.0, 0.0};
  if (u >= 1.0) return {1.0, 0.0, 0.0};
  return {u * u * u * (10.0 + u * (6.0 * u - 15.0)), 30.0 * u * u * (u - 1.0) * (u - 1.0),
          60.0 * u * (1.0 + u * (2.0 * u - 3.0))};
}

Motion fadeIn(const Motion& path, double since_s) {
  const Fade fade = computeFade(since_s / kFadeInS);
  const double slope = fade.slope / kFadeInS, curvature = fade.curvature / (kFadeInS * kFadeInS);
  Motion motion;
  motion.position_m = fade.value * path.position_m;
  motion.velocity_mps = fade.value * path.velocity_mps + slope * path.position_m;
  motion.acceleration_mps2 =
      fade.value * path.acceleration_mps2 + 2.0 * slope * path.velocity_mps + curvature * path.position_m;
  return motion;
}

}  // namespace brash_ice_rig
