#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace brash_ice_rig {

/// FNV-1a over 64-bit words, http://www.isthe.com/chongo/tech/comp/fnv. A change of a single word always shows; it is
/// no protection against forgery.
class Hash {
 public:
  /// What is added in several calls counts as in one where all but the last are multiples of 8 bytes.
  void add(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    while (size > 0) {
      std::uint64_t word = 0;
      const std::size_t taken = std::min(size, sizeof word);
      std::memcpy(&word, bytes, taken);
      value_ = (value_ ^ word) * 1099511628211ull;
      bytes += taken;
      size -= taken;
    }
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 14695981039346656037ull;
};

}  // namespace brash_ice_rig
