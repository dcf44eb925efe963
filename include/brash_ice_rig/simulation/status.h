#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "brash_ice_rig/system/state_visitor.h"

namespace brash_ice_rig {

/// Running trouble. Each flag has a text that says the remedy. Values are part of the ROS interface (SimStatus.msg).
enum class StatusFlag : std::uint32_t {
  kOverload = 1u << 0,
  kCommandTimeout = 1u << 1,
  kSpeedLimited = 1u << 2,
  kTravelLimit = 1u << 3,
  kCommandRejected = 1u << 4,
  kCommandIgnored = 1u << 5,
  kMultipleCommanders = 1u << 6,
  kFoldJammed = 1u << 7,
  kFoldUnlocked = 1u << 8,
  kContactSaturated = 1u << 9,
  kNonFinite = 1u << 10,
  kHoistSlack = 1u << 11,
};

/// Set of StatusFlag.
class StatusFlags {
 public:
  void set(StatusFlag flag, bool on = true) {
    const auto bit = static_cast<std::uint32_t>(flag);
    bits_ = on ? (bits_ | bit) : (bits_ & ~bit);
  }
  bool has(StatusFlag flag) const { return (bits_ & static_cast<std::uint32_t>(flag)) != 0; }
  bool any() const { return bits_ != 0; }
  std::uint32_t bits() const { return bits_; }
  StatusFlags& operator|=(StatusFlags other) {
    bits_ |= other.bits_;
    return *this;
  }

  void visitState(StateVisitor& visitor) { visitor("flags", bits_); }

 private:
  std::uint32_t bits_ = 0;
};

/// Lower-case name of a flag, e.g. "travel_limit".
const char* statusName(StatusFlag flag);

/// What happened and what to do about it, one sentence each.
const char* statusRemedy(StatusFlag flag);

/// The flags that are set, in the order of their bits.
std::vector<StatusFlag> activeFlags(StatusFlags flags);

}  // namespace brash_ice_rig
