#include "brash_ice_rig/teleop/key_teleop.h"

#include <algorithm>
#include <array>
#include <utility>

namespace brash_ice_rig {
namespace {

constexpr char kEscape = '\x1b';
constexpr std::size_t kLongestSequence = 8;

std::optional<Key> keyOfCharacter(char character) {
  switch (character) {
    case 'w':
      return Key::kHoistUp;
    case 's':
      return Key::kHoistDown;
    case 'd':
      return Key::kBoomXPlus;
    case 'a':
      return Key::kBoomXMinus;
    case 'r':
      return Key::kBoomYPlus;
    case 'f':
      return Key::kBoomYMinus;
    case 'o':
      return Key::kUnfold;
    case 'c':
      return Key::kFold;
    case ' ':
      return Key::kStop;
    case '+':
    case '=':  // + without shift on many keyboards
      return Key::kFaster;
    case '-':
      return Key::kSlower;
    case 't':
      return Key::kTare;
    case 'q':
    case '\x03':  // Ctrl-C and Ctrl-D, where the terminal hands them on
    case '\x04':
      return Key::kQuit;
    default:
      return {};
  }
}

/// Arrows come as ESC [ A, or ESC O A in the application mode of the cursor keys.
std::optional<Key> keyOfSequence(const std::string& sequence) {
  if (sequence.size() != 3) return {};
  switch (sequence[2]) {
    case 'A':
      return Key::kHoistUp;
    case 'B':
      return Key::kHoistDown;
    case 'C':
      return Key::kBoomXPlus;
    case 'D':
      return Key::kBoomXMinus;
    default:
      return {};
  }
}

std::optional<Eigen::Vector3d> directionOf(Key key) {
  switch (key) {
    case Key::kHoistUp:
      return Eigen::Vector3d(0.0, 0.0, 1.0);
    case Key::kHoistDown:
      return Eigen::Vector3d(0.0, 0.0, -1.0);
    case Key::kBoomXPlus:
      return Eigen::Vector3d(1.0, 0.0, 0.0);
    case Key::kBoomXMinus:
      return Eigen::Vector3d(-1.0, 0.0, 0.0);
    case Key::kBoomYPlus:
      return Eigen::Vector3d(0.0, 1.0, 0.0);
    case Key::kBoomYMinus:
      return Eigen::Vector3d(0.0, -1.0, 0.0);
    default:
      return {};
  }
}

}  // namespace

std::vector<Key> KeyReader::read(std::string_view bytes) {
  std::vector<Key> keys;
  for (const char byte : bytes) {
    if (byte == kEscape) {
      pending_ = byte;  // a lone escape before it means nothing
      continue;
    }
    if (pending_.empty()) {
      if (const auto key = keyOfCharacter(byte)) keys.push_back(*key);
      continue;
    }
    pending_ += byte;
    const bool introduced = pending_[1] == '[' || pending_[1] == 'O';
    const bool complete = pending_.size() > 2 && byte >= '@' && byte <= '~';
    if (introduced && !complete && pending_.size() < kLongestSequence) continue;
    if (const auto key = introduced ? keyOfSequence(pending_) : std::nullopt) keys.push_back(*key);
    pending_.clear();
  }
  return keys;
}

KeyTeleop::KeyTeleop(double speed_mps) : speed_mps_(std::clamp(speed_mps, kSlowestMps, kFastestMps)) {}

Eigen::Vector3d KeyTeleop::velocity() const {
  return speed_mps_ * *directionOf(*direction_);
}

TeleopCommand KeyTeleop::press(Key key, double now_s, std::optional<double> fold_ratio) {
  TeleopCommand command;
  if (directionOf(key)) {
    const bool repeated = direction_ == key;
    direction_ = key;
    held_until_s_ = now_s + (repeated ? kRepeatHoldS : kFirstHoldS);
    command.velocity_mps = velocity();
  } else if (key == Key::kFaster) {
    speed_mps_ = std::min(1.25 * speed_mps_, kFastestMps);
  } else if (key == Key::kSlower) {
    speed_mps_ = std::max(speed_mps_ / 1.25, kSlowestMps);
  } else if (key == Key::kUnfold) {
    command.fold_target = 1.0;
  } else if (key == Key::kFold) {
    command.fold_target = 0.0;
  } else if (key == Key::kStop || key == Key::kQuit) {
    // Stop also sends its zero when nothing moves by this keyboard: it may be another commander that has to be stopped.
    if (key == Key::kStop || direction_) command.velocity_mps = Eigen::Vector3d::Zero();
    if (key == Key::kStop && fold_ratio) command.fold_target = std::clamp(*fold_ratio, 0.0, 1.0);
    direction_.reset();
  }
  return command;
}

TeleopCommand KeyTeleop::update(double now_s) {
  TeleopCommand command;
  if (!direction_) return command;
  if (now_s < held_until_s_) {
    command.velocity_mps = velocity();
  } else {
    direction_.reset();
    command.velocity_mps = Eigen::Vector3d::Zero();
  }
  return command;
}

}  // namespace brash_ice_rig
