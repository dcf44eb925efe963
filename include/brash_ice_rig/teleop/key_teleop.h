#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/teleop/teleop_command.h"

namespace brash_ice_rig {

/// What a key of the terminal means to the rig.
enum class Key {
  kHoistUp,
  kHoistDown,
  kBoomXPlus,
  kBoomXMinus,
  kBoomYPlus,
  kBoomYMinus,
  kUnfold,
  kFold,
  kStop,
  kFaster,
  kSlower,
  kTare,
  kQuit
};

/// Turns the bytes that a terminal sends into keys. Arrow keys are several bytes, which may come in pieces.
class KeyReader {
 public:
  /// Keys that mean nothing are left out.
  std::vector<Key> read(std::string_view bytes);

 private:
  std::string pending_;  ///< beginning of an escape sequence
};

/// Crane and fold by single keys. A terminal reports no release of a key, only its repetition while it is held down: a
/// direction counts until its repetition fails to come. Then one zero is sent, and nothing any more.
class KeyTeleop {
 public:
  /// From the first press to the first repetition: X's default is 0.66 s, a console's 0.25 s.
  static constexpr double kFirstHoldS = 0.75;
  /// From one repetition to the next: about 0.03 s.
  static constexpr double kRepeatHoldS = 0.2;
  static constexpr double kSlowestMps = 0.005;
  static constexpr double kFastestMps = 0.5;

  /// @param speed_mps  to begin with, cut to kSlowestMps..kFastestMps
  explicit KeyTeleop(double speed_mps);

  /// @param now_s  time of any steady clock, s
  /// @param fold_ratio  present one, at which kStop holds the arms; empty: unknown
  /// @return what to send at once
  TeleopCommand press(Key key, double now_s, std::optional<double> fold_ratio);

  /// Call some 20 times a second. @return what to send
  TeleopCommand update(double now_s);

  bool moving() const { return direction_.has_value(); }
  /// Of a direction that is held, m/s.
  double speed() const { return speed_mps_; }

 private:
  Eigen::Vector3d velocity() const;

  double speed_mps_;
  std::optional<Key> direction_;
  double held_until_s_ = 0.0;
};

}  // namespace brash_ice_rig
