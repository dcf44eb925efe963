#pragma once

#define BRASH_ICE_INLINE inline __attribute__((always_inline))

// A name with that of the instruction set behind it, for the one table of functions that a kernel file exports.
#define BRASH_ICE_JOIN_NAMES(a, b) a##b
#define BRASH_ICE_JOIN(a, b) BRASH_ICE_JOIN_NAMES(a, b)
#define BRASH_ICE_NAME_OF_SET(name) BRASH_ICE_JOIN(name, BRASH_ICE_INSTRUCTION_SET)

// For kernel files alone, which are compiled once per instruction set. Everything here has internal linkage, and a
// kernel file includes nothing else that defines functions which might not be inlined: the linker keeps only one copy
// of such a function, and that could be one for a machine that this is not.
//
// The types are vectors of the compiler (GCC and Clang). Operators work lane by lane; where the machine's registers are
// shorter, the compiler splits them, which leaves each lane's result the same.
namespace brash_ice_rig {
namespace {

using Float4 __attribute__((vector_size(16))) = float;
using Float8 __attribute__((vector_size(32))) = float;

/// A vector from memory of any alignment.
template <class Vector, class T>
BRASH_ICE_INLINE Vector load(const T* from) {
  Vector result;
  __builtin_memcpy(&result, from, sizeof(Vector));
  return result;
}

template <class Vector, class T>
BRASH_ICE_INLINE void store(T* to, const Vector& value) {
  __builtin_memcpy(to, &value, sizeof(Vector));
}

/// Lanes I... of a and b together; those of b count on from those of a.
template <int... I, class Vector>
BRASH_ICE_INLINE Vector shuffle(const Vector& a, const Vector& b) {
#if defined(__clang__) || __GNUC__ >= 12
  return __builtin_shufflevector(a, b, I...);
#else
  return __builtin_shuffle(a, b, decltype(a < b){I...});
#endif
}

/// Four lanes and four lanes.
BRASH_ICE_INLINE Float8 join(const Float4& a, const Float4& b) {
#if defined(__clang__) || __GNUC__ >= 12
  return __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
#else
  return Float8{a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]};
#endif
}

BRASH_ICE_INLINE Float4 low(const Float8& v) {
#if defined(__clang__) || __GNUC__ >= 12
  return __builtin_shufflevector(v, v, 0, 1, 2, 3);
#else
  return Float4{v[0], v[1], v[2], v[3]};
#endif
}

BRASH_ICE_INLINE Float4 high(const Float8& v) {
#if defined(__clang__) || __GNUC__ >= 12
  return __builtin_shufflevector(v, v, 4, 5, 6, 7);
#else
  return Float4{v[4], v[5], v[6], v[7]};
#endif
}

}  // namespace
}  // namespace brash_ice_rig
