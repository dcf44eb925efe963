#pragma once

#include <cstddef>
#include <cstdint>

// For kernel files alone, which are compiled once per instruction set. Everything here has internal linkage, and a
// kernel file includes nothing else that defines functions: the linker keeps only one copy of an inline function, and
// that could be one for a machine that this is not.
//
// The types are vectors of the compiler (GCC and Clang). Operators work lane by lane; where the machine's registers are
// shorter, the compiler splits them, which leaves each lane's result the same.
namespace brash_ice_rig {
namespace {

typedef float Float4 __attribute__((vector_size(16)));
typedef float Float8 __attribute__((vector_size(32)));
typedef std::int32_t Int8 __attribute__((vector_size(32)));
typedef double Double8 __attribute__((vector_size(64)));
typedef std::int64_t Long8 __attribute__((vector_size(64)));

constexpr std::size_t kLanes = 8;

/// A vector from memory of any alignment.
template <class Vector, class T>
inline __attribute__((always_inline)) Vector load(const T* from) {
  Vector result;
  __builtin_memcpy(&result, from, sizeof(Vector));
  return result;
}

template <class Vector, class T>
inline __attribute__((always_inline)) void store(T* to, const Vector& value) {
  __builtin_memcpy(to, &value, sizeof(Vector));
}

}  // namespace
}  // namespace brash_ice_rig
