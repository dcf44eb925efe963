#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "brash_ice_rig/config/range.h"

namespace brash_ice_rig {

class Effect;
class EffectValues;
struct Scenario;

/// What is believed of a parameter before any record is looked at. Two numbers a and b:
///   uniform      between a and b
///   normal       mean a, standard deviation b
///   log_normal   median a, standard deviation b of the natural logarithm
///   half_normal  |x| for x normal with mean 0 and standard deviation b; a is 0
enum class PriorKind { kNone, kUniform, kNormal, kLogNormal, kHalfNormal };
struct Prior {
  PriorKind kind = PriorKind::kNone;
  double a = 0.0, b = 0.0;
};

/// Lower-case name, e.g. "half_normal"; "none" for a parameter that no record can tell.
const char* priorName(PriorKind kind);

enum class ParameterRole {
  kAmplitude,  ///< how much of the effect there is: with all amplitudes at 0 it does nothing
  kShape,      ///< how it acts
  kSetting,    ///< a choice or a known number, not to be found from a record
};

/// One key effects.NAME.KEY. Units are SI and part of the key's name.
struct EffectParameter {
  enum class Kind { kNumber, kWhole, kSwitch };

  const char* name = "";
  const char* unit = "";  ///< e.g. "s"; "1" for a ratio, empty for a switch
  Kind kind = Kind::kNumber;
  double default_value = 0.0;  ///< 0 or 1 for a switch
  Range range;
  Prior prior;
  ParameterRole role = ParameterRole::kSetting;
  /// The load cell's reading changes in proportion to it, while it is small.
  bool linear = false;
  /// Identification tries this shape at its prior's median and one deviation of it to either side.
  bool tried = false;
  const char* text = "";
};

/// @param linear  see EffectParameter
EffectParameter amplitude(const char* name, const char* unit, double default_value, const Range& range,
                          const Prior& prior, bool linear, const char* text);
EffectParameter shape(const char* name, const char* unit, double default_value, const Range& range, const Prior& prior,
                      const char* text);
/// A shape that changes what the load cell shows by more than two arrangements of the blocks differ: identification
/// spends two simulations more on it. At most one of an effect.
/// @param prior  log-normal
EffectParameter triedShape(const char* name, const char* unit, double default_value, const Range& range,
                           const Prior& prior, const char* text);
EffectParameter setting(const char* name, const char* unit, double default_value, const Range& range, const char* text);
EffectParameter wholeSetting(const char* name, double default_value, const Range& range, const char* text);
EffectParameter switchSetting(const char* name, bool default_value, const char* text);

/// Everything that is known of an effect without running it.
struct EffectDescription {
  const char* name = "";       ///< as in effects.NAME, lower case
  const char* mechanism = "";  ///< one line, for scenario files and reports
  std::vector<EffectParameter> parameters;
  /// Effects that look the same in one record of a plain lift, and what tells them apart. With half of the evidence
  /// they are rivals.
  std::vector<const char*> confusable_with;
  const char* how_to_tell = "";
  /// The true forces stay what they were: the reading follows from them without another run.
  bool reading_only = false;
  /// It acts on the rig alone: what it does to the load cell is the same in any ice.
  bool spares_ice = false;
  /// Of what happens at a moment: how far its law may have that wrong, standard deviation, s. 0 of what goes on;
  /// [0, 10].
  double timing_sigma_s = 0.0;
  /// Lateral channels of a load cell show it. Of others a change of lateral force counts as scatter.
  bool acts_sideways = false;
  /// It begins with procedure.rest_duration_s, before the lift. All others begin at time 0.
  bool acts_at_rest = false;
  /// It uses IceChanges::strength_ratio, or the arrays of mass in IceChanges and FieldAtCreation.
  bool changes_strength = false;
  bool changes_mass = false;
  /// The energy balance stays complete. Otherwise output.energy is refused beside it.
  bool in_energy_balance = false;
  std::function<std::unique_ptr<Effect>(const EffectValues&, const Scenario&)> make;
  /// Rules that tie its keys to others; throws ConfigError. May be empty. Called for an effect that is enabled.
  std::function<void(const EffectValues&, const Scenario&)> check;
};

/// All effects, in the order in which they act: those of the library first, then those that were registered.
/// References into it stay valid.
const std::deque<EffectDescription>& effectRegistry();

/// The effect of that name, or null.
const EffectDescription* findEffect(const std::string& name);

/// @throws std::invalid_argument that names effect, parameter and rule, if a name is not made of a-z, 0-9 and _; if
///   `make` is missing; if timing_sigma_s is not in [0, 10]; if a parameter is there twice, if its default, its prior
///   or 0 of an amplitude is not in its range, or if it is tried though triedShape() does not allow it
void checkDescription(const EffectDescription& description);

/// Adds an effect of the user's own. Its keys belong to each Scenario made from then on.
/// Call before any scenario is made and before there are several threads.
/// @throws std::invalid_argument as checkDescription() does, or if the name is taken
void registerEffect(EffectDescription description);

/// The keys effects.NAME.* of one effect.
class EffectValues {
 public:
  explicit EffectValues(const EffectDescription& description);

  const EffectDescription& description() const { return *description_; }

  bool enabled = false;

  /// Value of a number, whole number or switch (0 or 1).
  /// @throws std::out_of_range if there is no such parameter
  double operator[](const std::string& name) const;
  /// Sets it, unchecked: Scenario::validate() looks at the range.
  /// @throws std::out_of_range if there is no such parameter
  void set(const std::string& name, double value);

  template <class Visitor>
  void visit(Visitor& v) {
    v("enabled", enabled, description_->mechanism);
    for (std::size_t i = 0; i < values_.size(); ++i) {
      const EffectParameter& p = description_->parameters[i];
      switch (p.kind) {
        case EffectParameter::Kind::kNumber:
          v(p.name, values_[i].number, p.range, p.text);
          break;
        case EffectParameter::Kind::kWhole:
          v(p.name, values_[i].whole, p.range, p.text);
          break;
        case EffectParameter::Kind::kSwitch:
          v(p.name, values_[i].on, p.text);
          break;
      }
    }
  }

 private:
  struct Value {
    double number = 0.0;
    std::uint64_t whole = 0;
    bool on = false;
  };
  std::size_t indexOf(const std::string& name) const;

  const EffectDescription* description_;
  std::vector<Value> values_;  ///< one per parameter
};

/// Section `effects` of a scenario: one section per registered effect, all off at first.
class EffectsConfig {
 public:
  EffectsConfig();

  /// @throws std::out_of_range if there is no such effect
  EffectValues& operator[](const std::string& name);
  const std::vector<EffectValues>& all() const { return effects_; }

  template <class Visitor>
  void visit(Visitor& v) {
    for (EffectValues& effect : effects_) v.section(effect.description().name, effect);
  }

 private:
  std::vector<EffectValues> effects_;
};

}  // namespace brash_ice_rig
