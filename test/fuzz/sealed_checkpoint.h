#pragma once

#include <cstdint>
#include <cstring>
#include <string>

#include "brash_ice_rig/system/hash.h"

namespace brash_ice_rig {

constexpr std::size_t kCheckpointHeader = 24;
constexpr std::size_t kCheckpointSectionName = 24;
constexpr std::size_t kCheckpointTail = 8;

template <class Value>
Value valueAt(const std::string& text, std::size_t place) {
  Value value{};
  std::memcpy(&value, text.data() + place, sizeof value);
  return value;
}

template <class Value>
void setValueAt(std::string& text, std::size_t place, const Value& value) {
  std::memcpy(text.data() + place, &value, sizeof value);
}

/// A checkpoint without its last 8 bytes, made consistent as a whole: magic, byte order, version, size and checksum are
/// right, as a forger would set them. Too short a text is filled up.
inline std::string sealed(std::string file) {
  if (file.size() < kCheckpointHeader) file.resize(kCheckpointHeader);
  std::memcpy(file.data(),
              "\x89"
              "BRIC\r\n\x1a",
              8);
  setValueAt(file, 8, std::uint32_t{0x01020304});
  setValueAt(file, 12, std::uint32_t{2});
  setValueAt(file, 16, std::uint64_t{file.size() + kCheckpointTail});
  Hash hash;
  hash.add(file.data(), file.size());
  const std::uint64_t value = hash.value();
  return file.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace brash_ice_rig
