#pragma once

namespace brash_ice_rig {

constexpr double kPi = 3.14159265358979323846;
constexpr double kDegree = kPi / 180.0;  ///< rad

}  // namespace brash_ice_rig
