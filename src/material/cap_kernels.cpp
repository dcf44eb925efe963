#include "brash_ice_rig/material/cap_kernels.h"

#if defined(__SSE2__)
#include <immintrin.h>  // its functions are always inlined
#endif

#include "brash_ice_rig/simd/lanes.h"

namespace brash_ice_rig {
namespace {

// As many doubles as the registers of the machine hold. Lanes do not meet, so that their number does not show.
#if defined(__AVX512F__)
constexpr std::size_t kWidth = 8;
#elif defined(__AVX2__)
constexpr std::size_t kWidth = 4;
#else
constexpr std::size_t kWidth = 2;
#endif
using Doubles __attribute__((vector_size(8 * kWidth))) = double;
using Floats __attribute__((vector_size(4 * kWidth))) = float;
using Mask __attribute__((vector_size(8 * kWidth))) = std::int64_t;  // all bits of a lane are set, or none
using Bits __attribute__((vector_size(8 * kWidth))) = std::uint64_t;
// As many floats as the registers hold, for the elastic pass.
constexpr std::size_t kFloatWidth = 2 * kWidth;
using WideFloats __attribute__((vector_size(4 * kFloatWidth))) = float;
using WideMask __attribute__((vector_size(4 * kFloatWidth))) = std::int32_t;

constexpr double kLargestLastStep = 3e-5;  // relative; what its square neglects is below the tolerance
constexpr double kLastError = 1e-10;       // relative
constexpr int kMaxIterations = 60;         // a return that takes more is left
constexpr double kLargestFloat = 3.4028234663852886e38;
constexpr double kRootOfThree = 1.7320508075688772;

// What the compiler's vectors do not do well by themselves.

BRASH_ICE_INLINE Doubles select(Mask mask, Doubles yes, Doubles no) {
#if defined(__AVX512F__)
  return mask ? yes : no;
#elif defined(__AVX2__)
  return _mm256_blendv_pd(no, yes, (__m256d)mask);
#else
  return (Doubles)(((Mask)yes & mask) | ((Mask)no & ~mask));
#endif
}

BRASH_ICE_INLINE bool any(Mask mask) {
#if defined(__AVX512F__)
  return _mm512_test_epi64_mask((__m512i)mask, (__m512i)mask) != 0;
#elif defined(__AVX2__)
  return _mm256_movemask_pd((__m256d)mask) != 0;
#else
  return (mask[0] | mask[1]) != 0;
#endif
}

BRASH_ICE_INLINE WideFloats select(WideMask mask, WideFloats yes, WideFloats no) {
#if defined(__AVX512F__)
  return mask ? yes : no;
#elif defined(__AVX2__)
  return _mm256_blendv_ps(no, yes, (__m256)mask);
#else
  return (WideFloats)(((WideMask)yes & mask) | ((WideMask)no & ~mask));
#endif
}

/// A bit per lane.
BRASH_ICE_INLINE std::uint64_t bitsOf(WideMask mask) {
#if defined(__AVX512F__)
  return _mm512_test_epi32_mask((__m512i)mask, (__m512i)mask);
#elif defined(__AVX2__)
  return static_cast<std::uint32_t>(_mm256_movemask_ps((__m256)mask));
#else
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < kFloatWidth; ++i) bits |= static_cast<std::uint64_t>(mask[i] & 1) << i;
  return bits;
#endif
}

BRASH_ICE_INLINE Doubles widen(Floats value) {
#if defined(__AVX512F__)
  return _mm512_maskz_cvtps_pd(0xff, value);
#elif defined(__AVX2__)
  return _mm256_cvtps_pd(value);
#elif defined(__SSE2__)
  return _mm_cvtps_pd(__m128{value[0], value[1], 0.0f, 0.0f});
#else
  return __builtin_convertvector(value, Doubles);
#endif
}
BRASH_ICE_INLINE Doubles widen(const float* from) {
  return widen(load<Floats>(from));
}

BRASH_ICE_INLINE Doubles splat(double value) {
  return value - Doubles{};
}
BRASH_ICE_INLINE Doubles abs(Doubles x) {
  return (Doubles)((Bits)x & ~(1ull << 63));
}
BRASH_ICE_INLINE WideFloats abs(WideFloats x) {
  return (WideFloats)((WideMask)x & 0x7fffffff);
}
BRASH_ICE_INLINE Doubles larger(Doubles a, Doubles b) {
  return select(a < b, b, a);
}
BRASH_ICE_INLINE Doubles smaller(Doubles a, Doubles b) {
  return select(b < a, b, a);
}

/// To float, clamped to its range.
BRASH_ICE_INLINE Floats narrow(Doubles value) {
  value = larger(smaller(value, splat(kLargestFloat)), splat(-kLargestFloat));
#if defined(__AVX512F__)
  return _mm512_maskz_cvtpd_ps(0xff, value);
#elif defined(__AVX2__)
  return _mm256_cvtpd_ps(value);
#elif defined(__SSE2__)
  const __m128 floats = _mm_cvtpd_ps(value);
  return Floats{floats[0], floats[1]};
#else
  Floats floats = __builtin_convertvector(value, Floats);
  __asm__("" : "+m"(floats));  // GCC 12 drops the rounding where a widening follows
  return floats;
#endif
}
BRASH_ICE_INLINE Doubles asFloat(Doubles value) {
  return widen(narrow(value));
}

BRASH_ICE_INLINE Mask isFinite(Doubles x) {
  return x - x == 0.0;  // NOLINT(misc-redundant-expression): NaN for all others
}

BRASH_ICE_INLINE Doubles squareRoot(Doubles x) {
  Doubles result;
  for (std::size_t i = 0; i < kWidth; ++i) result[i] = __builtin_sqrt(x[i]);
  return result;
}

/// Sum of c[i] x^i, i < n, in Estrin's order, whose chain of operations is short.
/// @param powers  x, x², x⁴, ...
template <std::size_t n>
BRASH_ICE_INLINE Doubles computeSum(const double* c, const Doubles* powers) {
  if constexpr (n == 1) {
    return splat(c[0]);
  } else if constexpr (n == 2) {
    return c[0] + c[1] * powers[0];
  } else {
    constexpr std::size_t kHalf = n > 8 ? 8 : n > 4 ? 4 : 2;
    return computeSum<kHalf>(c, powers) + computeSum<n - kHalf>(c + kHalf, powers) * powers[kHalf == 8 ? 3 : kHalf / 2];
  }
}

/// Polynomial of degree n - 1 ≤ 15, the constant term first.
template <std::size_t n>
BRASH_ICE_INLINE Doubles polynomial(const double (&coefficients)[n], Doubles x) {
  static_assert(n <= 16);
  const Doubles square = x * x, fourth = square * square;
  const Doubles powers[] = {x, square, fourth, fourth * fourth};
  return computeSum<n>(coefficients, powers);
}

constexpr double kLn2High = 0x1.62e42fefa0000p-1, kLn2Low = 0x1.cf79abc9e3b3ap-40;  // the first times 2^11 is exact

// The polynomials below interpolate their functions at Chebyshev's points; the errors are the largest of a fine grid.

/// ln x of positive normal numbers: x = 2^k m with m about 1, ln m = 2 artanh((m - 1) / (m + 1)).
BRASH_ICE_INLINE Doubles computeLog(Doubles x) {
  // (2 artanh(s) - 2 s) / s³ in s², to 2e-18 of s.
  constexpr double kCoefficients[] = {0.66666666666666696, 0.39999999999899444, 0.2857142862600327, 0.22222211130259878,
                                      0.18182889455674947, 0.15331710618210773, 0.14616585424888623};
  constexpr std::uint64_t kRootOfHalf = 0x3fe6a09e667f3bcdull, kBias = 1023, kTwoTo52 = 0x4330000000000000ull;
  const Bits bits = (Bits)x;
  const Bits exponent = (bits - kRootOfHalf + (kBias << 52)) >> 52;  // k + bias
  const Doubles m = (Doubles)(bits + (kBias << 52) - (exponent << 52));
  const Doubles k = (Doubles)(exponent | kTwoTo52) - (0x1p52 + 1023.0);
  const Doubles s = (m - 1.0) / (m + 1.0);
  const Doubles z = s * s;
  return k * kLn2High + (2.0 * s + (s * z * polynomial(kCoefficients, z) + k * kLn2Low));
}

/// ln(1 + r) for |r| ≤ 1/32.
BRASH_ICE_INLINE Doubles computeLogNearOne(Doubles r) {
  // (ln(1 + r) - r) / r², to 2e-17 / r.
  constexpr double kCoefficients[] = {-0.49999999999999928, 0.3333333333333327,   -0.2500000000233204,
                                      0.20000000002120089,  -0.16666654728256261, 0.14285703432369223,
                                      -0.1251955312667663,  0.11128886987006753};
  return r + r * r * polynomial(kCoefficients, r);
}

/// e^x = 2^k e^r with |r| ≤ ln(2) / 2.
BRASH_ICE_INLINE Doubles computeExp(Doubles x) {
  // (e^r - 1 - r) / r², to 2e-19.
  constexpr double kCoefficients[] = {0.5,
                                      0.16666666666666671,
                                      0.041666666666666671,
                                      0.0083333333333260838,
                                      0.0013888888888883711,
                                      0.00019841269875002279,
                                      2.4801587325677461e-05,
                                      2.7557255170000888e-06,
                                      2.7557273478718582e-07,
                                      2.5105312729622103e-08,
                                      2.0914755325893202e-09};
  constexpr double kRounding = 0x1.8p52;  // added, it leaves the nearest integer in the low bits
  x = smaller(larger(x, splat(-700.0)), splat(700.0));
  const Doubles shifted = x * 1.4426950408889634 + kRounding;
  const Doubles k = shifted - kRounding;
  const Doubles r = (x - k * kLn2High) - k * kLn2Low;
  const Doubles fraction = 1.0 + (r + r * r * polynomial(kCoefficients, r));
  return (Doubles)((Bits)fraction + ((Bits)shifted << 52));
}

/// Largest eigenvalue: mean + 2 sqrt(J2 / 3) cos(acos(x) / 3), x = det(deviator) / 2 over (J2 / 3)^1.5. In
/// u = cos(acos(x) / 2) that cosine is cos(2/3 acos(u)), which has no singularity near [0, 1].
BRASH_ICE_INLINE Doubles computeLargestPrincipal(const Doubles* c) {
  // To 9e-15.
  constexpr double kCoefficients[] = {
      0.50000000000000688,    0.57735026918611321,    -0.11111111080995631,    0.053458347977806624,
      -0.032921624935559883,  0.022866248978971111,   -0.017055565944752826,   0.013293041113790259,
      -0.010550248345813997,  0.008209146896930546,   -0.0059209996385766253,  0.0036912026322573066,
      -0.0018389155831255988, 0.00066762461648365212, -0.00015425694291050363, 1.6840798339836843e-05};
  const Doubles mean = (c[0] + c[1] + c[2]) * (1.0 / 3.0);
  const Doubles xx = c[0] - mean, yy = c[1] - mean, zz = c[2] - mean;
  const Doubles third = (0.5 * (xx * xx + yy * yy + zz * zz) + (c[3] * c[3] + c[4] * c[4] + c[5] * c[5])) * (1.0 / 3.0);
  const Doubles determinant =
      xx * (yy * zz - c[4] * c[4]) - c[3] * (c[3] * zz - c[4] * c[5]) + c[5] * (c[3] * c[4] - yy * c[5]);
  const Doubles radius = squareRoot(third);
  const Doubles cube = radius * third;
  // Where the cube is not a normal number, the deviator is nothing beside what float resolves.
  const Doubles x = select(cube > 1e-300, 0.5 * determinant / cube, Doubles{});
  const Doubles u = squareRoot(smaller(larger(0.5 + 0.5 * x, Doubles{}), splat(1.0)));
  return mean + 2.0 * radius * polynomial(kCoefficients, u);
}

// ------------------------------------------------------------------------------------------------------- elastic pass

/// Pointers into the arrays of a batch. The first six are read only.
struct Arrays {
  const float* strain[6];
  float* stress[6];
  float* state[kCapStates];
};

/// Elastic predictor in float, and a check with a lower bound of the cap's intercept that needs no logarithm; since the
/// surface grows with X, what it calls elastic is elastic. Where a damage threshold is set, it settles those under
/// pressure whose damage does not grow.
class ElasticPass {
 public:
  explicit ElasticPass(const CapConstants& p)
      : gap_memory_(p.gap_memory),
        damages_(p.damages),
        shear_2_(static_cast<float>(2.0 * p.shear_modulus_pa)),
        lame_(static_cast<float>(p.bulk_modulus_pa - 2.0 / 3.0 * p.shear_modulus_pa)),
        alpha_(static_cast<float>(p.alpha_pa)),
        theta_(static_cast<float>(p.theta)),
        apex_(static_cast<float>(p.apex_pa)),
        inverse_width_ratio_(static_cast<float>(1.0 / p.width_ratio)),
        initial_intercept_(static_cast<float>(p.initial_intercept_pa * (1.0 - 1e-5))),
        inverse_max_compaction_(static_cast<float>((1.0 - 1e-5) / p.max_compaction)),
        d1_(static_cast<float>(p.d1_per_pa)),
        d2_per_d1_(static_cast<float>(p.d2_per_pa2 / p.d1_per_pa)),
        factor_2_(static_cast<float>(p.smallest_lode_factor * p.smallest_lode_factor)),
        max_damage_(static_cast<float>(p.max_damage)),
        excess_shear_(static_cast<float>(0.5 * (1.0 - p.stiffness_scale) / p.shear_modulus_pa)),
        excess_volume_(static_cast<float>((1.0 - p.stiffness_scale) *
                                          (1.0 / (6.0 * p.shear_modulus_pa) - 1.0 / (9.0 * p.bulk_modulus_pa)))) {}

  /// Updates kFloatWidth particles.
  /// @return a bit for each that this does not settle, and leaves as it was
  BRASH_ICE_INLINE std::uint64_t update(const Arrays& at, std::size_t i) const {
    const WideFloats none{}, one = none + 1.0f;
    WideFloats strain[6], old[6];
    for (std::size_t c = 0; c < 6; ++c) {
      strain[c] = load<WideFloats>(at.strain[c] + i);
      old[c] = load<WideFloats>(at.stress[c] + i);
    }
    const WideFloats opening = strain[0] + strain[1] + strain[2];
    const WideFloats volume_part = lame_ * opening;
    WideFloats damage{}, integrity = one, inverse_integrity = one;
    if (damages_) {
      damage = load<WideFloats>(at.state[kDamage] + i);
      integrity = 1.0f - select(damage > max_damage_, none + max_damage_, damage);
      inverse_integrity = 1.0f / integrity;
    }
    WideFloats increment[6], stress[6];  // without damage
    for (std::size_t c = 0; c < 6; ++c) {
      increment[c] = c < 3 ? shear_2_ * strain[c] + volume_part : shear_2_ * strain[c];
      stress[c] = old[c] * inverse_integrity + increment[c];
    }
    const WideFloats j1 = -(stress[0] + stress[1] + stress[2]);
    const WideFloats pressure = j1 * (1.0f / 3.0f);
    const WideFloats dx = stress[0] + pressure, dy = stress[1] + pressure, dz = stress[2] + pressure;
    const WideFloats j2 =
        0.5f * (dx * dx + dy * dy + dz * dz) + (stress[3] * stress[3] + stress[4] * stress[4] + stress[5] * stress[5]);

    // -ln(1 - u) > u (6 - u) / (6 - 4 u) on (0, 1), and y > l / (D1 + D2 l / D1) for the root y of eq. 12.
    const WideFloats scaled = load<WideFloats>(at.state[kCompaction] + i) * inverse_max_compaction_;
    const WideFloats u = select(scaled > one, one, select(scaled < none, none, scaled));
    const WideFloats numerator = u * (6.0f - u);
    const WideFloats intercept = initial_intercept_ + numerator / ((6.0f - 4.0f * u) * d1_ + d2_per_d1_ * numerator);
    const WideFloats raw_t = 1.0f - (intercept - j1) * inverse_width_ratio_ / (intercept + apex_);
    const WideFloats t = select(raw_t < none, none, raw_t);
    const WideFloats cone = alpha_ + theta_ * j1;
    WideMask elastic = (cone >= none) & (j2 <= factor_2_ * (cone * cone) * (1.0f - t * t));
    if (gap_memory_) {
      elastic &= (load<WideFloats>(at.state[kGap] + i) == none) | (j1 <= none) | (opening >= none);
    }
    if (damages_) {
      WideFloats total[6];
      for (std::size_t c = 0; c < 6; ++c) total[c] = load<WideFloats>(at.state[kTotalStrain + c] + i) + strain[c];
      const WideFloats ductile = load<WideFloats>(at.state[kDuctileThreshold] + i);
      const WideMask intact = (load<WideFloats>(at.state[kBrittleThreshold] + i) == none) & (ductile == none);
      // Where a threshold is set, damage may grow without yielding.
      WideMask keeps = (j1 >= none) & (damage == load<WideFloats>(at.state[kDuctileDamage] + i)) &
                       ((ductile == none) | (computeLargestMeasureSquared(total, stress, j1) < ductile * ductile));
      if (gap_memory_) keeps &= load<WideFloats>(at.state[kGap] + i) == none;
      elastic &= intact | keeps;
      for (std::size_t c = 0; c < 6; ++c) {
        float* const to = at.state[kTotalStrain + c] + i;
        store(to, select(elastic, total[c], load<WideFloats>(to)));
      }
    }
    for (std::size_t c = 0; c < 6; ++c) {
      store(at.stress[c] + i, select(elastic, old[c] + integrity * increment[c], old[c]));
    }
    return bitsOf(~elastic);
  }

 private:
  /// Upper bound of the squared measure of ductile damage, see measureDuctile.
  BRASH_ICE_INLINE WideFloats computeLargestMeasureSquared(const WideFloats* total, const WideFloats* stress,
                                                           const WideFloats& j1) const {
    constexpr float kRounding = 2e-6f;  // of the terms, more than what float loses in them
    const WideFloats volume_part = excess_volume_ * j1;
    WideFloats sum{}, size{};
    for (std::size_t c = 0; c < 6; ++c) {
      const float weight = c < 3 ? 0.5f : 1.0f;
      WideFloats excess = excess_shear_ * stress[c];
      if (c < 3) excess += volume_part;
      sum += weight * stress[c] * (total[c] - excess);
      size += weight * abs(stress[c]) * (abs(total[c]) + abs(excess));
    }
    return sum + kRounding * size;
  }

  bool gap_memory_, damages_;
  float shear_2_, lame_, alpha_, theta_, apex_, inverse_width_ratio_;
  float initial_intercept_, inverse_max_compaction_, d1_, d2_per_d1_, factor_2_;
  float max_damage_, excess_shear_, excess_volume_;
};

/// The particles of a tile that the elastic pass does not settle.
struct OpenList {
  std::uint64_t bits[kCapTile / 64];
  std::uint32_t index[kCapTile];  // the same in a list
  std::size_t count;
};

void updateElastic(const CapConstants& p, const Arrays& arrays, std::size_t count, OpenList& open) {
  const ElasticPass pass(p);
  for (std::uint64_t& bits : open.bits) bits = 0;
  std::size_t i = 0;
  for (; i + kFloatWidth <= count; i += kFloatWidth) open.bits[i / 64] |= pass.update(arrays, i) << (i % 64);
  if (i < count) {
    // The last ones, in arrays that are long enough.
    float padded[12 + kCapStates][kFloatWidth] = {};
    const std::size_t bytes = (count - i) * sizeof(float);
    Arrays copy{};
    std::size_t n = 0;
    for (std::size_t c = 0; c < 6; ++c) {
      copy.strain[c] = padded[n];
      __builtin_memcpy(padded[n++], arrays.strain[c] + i, bytes);
      copy.stress[c] = padded[n];
      __builtin_memcpy(padded[n++], arrays.stress[c] + i, bytes);
    }
    for (std::size_t j = 0; j < kCapStates; ++j) {
      if (arrays.state[j] == nullptr) continue;
      copy.state[j] = padded[n];
      __builtin_memcpy(padded[n++], arrays.state[j] + i, bytes);
    }
    const std::uint64_t bits = pass.update(copy, 0) & ((1ull << (count - i)) - 1);
    open.bits[i / 64] |= bits << (i % 64);
    for (std::size_t c = 0; c < 6; ++c) __builtin_memcpy(arrays.stress[c] + i, copy.stress[c], bytes);
    if (p.damages) {
      for (std::size_t j = kTotalStrain; j < kCapStates; ++j) {
        __builtin_memcpy(arrays.state[j] + i, copy.state[j], bytes);
      }
    }
  }
  open.count = 0;
  for (std::size_t word = 0; word < kCapTile / 64; ++word) {
    for (std::uint64_t bits = open.bits[word]; bits != 0; bits &= bits - 1) {
      open.index[open.count++] =
          static_cast<std::uint32_t>(64 * word) + static_cast<std::uint32_t>(__builtin_ctzll(bits));
    }
  }
}

// ------------------------------------------------------------------------------------------------ return of open ones

constexpr std::size_t kRoom = kCapTile + 16;  // whole registers may be stored behind the last one

/// The open particles of a tile, side by side. Copies of the last one fill up the last group of lanes.
struct Open {
  // In and out.
  alignas(64) float strain[6][kRoom];
  alignas(64) float stress[6][kRoom];
  alignas(64) float state[kCapStates][kRoom];
  // Between the stages: the trial, its cap, and the point that it returns to, undamaged.
  alignas(64) double trial[6][kCapTile];
  alignas(64) double trial_j1[kCapTile], trial_s[kCapTile];
  alignas(64) double start[kCapTile], width[kCapTile], inverse_width[kCapTile], hardening[kCapTile];
  alignas(64) double logarithm[kCapTile], inverse_rest[kCapTile];
  alignas(64) double j1[kCapTile], s[kCapTile];
  alignas(64) double increment[kCapTile];  // plastic compaction of this step
  alignas(64) std::int64_t yields[kCapTile];
  alignas(64) std::int64_t left[kCapTile];
  std::uint32_t yielding[kCapTile];  // which ones yield
  // Damage: the strain that counts, the largest principal values of strain and stress where needed.
  alignas(64) double strain_of_damage[6][kCapTile];
  alignas(64) double measure[kCapTile], threshold[kCapTile], strongest[kCapTile];
  alignas(64) std::int64_t tensile[kCapTile], grows[kCapTile];
};

/// Some of a tile's groups of lanes: where they begin.
struct Groups {
  std::uint32_t begin[kCapTile / kWidth];
  std::size_t count = 0;

  /// @param belongs  whether it does
  BRASH_ICE_INLINE void add(std::size_t k, bool belongs) {
    begin[count] = static_cast<std::uint32_t>(k);
    count += belongs ? 1 : 0;
  }
};

std::size_t roundUp(std::size_t count) {
  return (count + kWidth - 1) / kWidth * kWidth;
}

struct Cap {
  Doubles start, width, inverse_width, hardening;
};

BRASH_ICE_INLINE Cap select(Mask mask, const Cap& yes, const Cap& no) {
  return {select(mask, yes.start, no.start), select(mask, yes.width, no.width),
          select(mask, yes.inverse_width, no.inverse_width), select(mask, yes.hardening, no.hardening)};
}

/// Where a cap starts to move from.
struct OldCap {
  Doubles compaction;    // within [0, onset of the tangent]
  Doubles logarithm;     // -ln(1 - e / W)
  Doubles inverse_rest;  // 1 / (W - e)
};

BRASH_ICE_INLINE Doubles compactionOfEq12(const CapConstants& p, Doubles compaction) {
  return smaller(select(compaction > 0.0, compaction, Doubles{}), splat(p.tangent_onset));
}

BRASH_ICE_INLINE Doubles computeLogarithm(const CapConstants& p, Doubles compaction) {
  return -computeLog(1.0 - compaction * (1.0 / p.max_compaction));
}

BRASH_ICE_INLINE OldCap computeOldCap(const CapConstants& p, Doubles compaction) {
  const Doubles e = compactionOfEq12(p, compaction);
  Doubles logarithm{};
  const Mask compacted = e > 0.0;
  if (any(compacted)) logarithm = select(compacted, computeLogarithm(p, e), logarithm);
  return {e, logarithm, 1.0 / (p.max_compaction - e)};
}

/// CapModel::capAt. With root = sqrt(D1² + 4 D2 l), a = D1 + root and b = (W - e) root:
/// X - X0 = 2 l / a + (compaction - e) / b and dX/de = 1 / b. These and 1 / width share one division.
/// @param e          compactionOfEq12(compaction)
/// @param logarithm  l = -ln(1 - e / W)
BRASH_ICE_INLINE Cap computeCap(const CapConstants& p, Doubles compaction, Doubles e, Doubles logarithm) {
  const Doubles root = squareRoot(p.d1_per_pa * p.d1_per_pa + (4.0 * p.d2_per_pa2) * logarithm);
  const Doubles a = p.d1_per_pa + root, b = (p.max_compaction - e) * root, a_b = a * b;
  const Doubles beyond = larger(compaction - e, Doubles{});
  const Doubles from_apex = ((p.initial_intercept_pa + p.apex_pa) * a + 2.0 * logarithm) * b + beyond * a;  // times a b
  const Doubles inverse = 1.0 / (a_b * from_apex);
  const Doubles inverse_a_b = inverse * from_apex;
  const Doubles distance = from_apex * inverse_a_b;  // X + apex
  return {(1.0 - p.width_ratio) * distance - p.apex_pa, p.width_ratio * distance,
          a_b * a_b * inverse * (1.0 / p.width_ratio), select(compaction > 0.0, a * inverse_a_b, Doubles{})};
}

BRASH_ICE_INLINE Cap computeVirginCap(const CapConstants& p) {
  return computeCap(p, Doubles{}, Doubles{}, Doubles{});
}

/// A cap not far from the old one, whose logarithm needs only a short sum.
BRASH_ICE_INLINE Cap moveCap(const CapConstants& p, const Cap& virgin, const OldCap& old, Doubles compaction) {
  const Doubles e = compactionOfEq12(p, compaction);
  const Mask compacted = e > 0.0;
  if (!any(compacted)) return virgin;
  const Doubles ratio = (old.compaction - e) * old.inverse_rest;
  Doubles logarithm = old.logarithm - computeLogNearOne(ratio);
  const Mask far = abs(ratio) > 0x1p-5;
  if (any(far)) logarithm = select(far, computeLogarithm(p, e), logarithm);
  return select(compacted, computeCap(p, compaction, e, logarithm), virgin);
}

/// Elastic predictor and CapModel::isElastic. Lists the particles that yield.
/// @return how many those are
std::size_t predict(const CapConstants& p, Open& open, std::size_t count) {
  const double inverse_bulk_3 = 1.0 / (3.0 * p.bulk_modulus_pa);
  const double lame = p.bulk_modulus_pa - 2.0 / 3.0 * p.shear_modulus_pa;
  for (std::size_t k = 0; k < count; k += kWidth) {
    Doubles strain[6], stress[6];
    Doubles integrity = splat(1.0);
    if (p.damages) integrity = 1.0 - smaller(widen(&open.state[kDamage][k]), splat(p.max_damage));
    const Doubles inverse_integrity = 1.0 / integrity;
    for (std::size_t c = 0; c < 6; ++c) {
      strain[c] = widen(&open.strain[c][k]);
      stress[c] = widen(&open.stress[c][k]) * inverse_integrity + (2.0 * p.shear_modulus_pa) * strain[c];
    }
    const Doubles volume = strain[0] + strain[1] + strain[2];
    for (std::size_t c = 0; c < 3; ++c) stress[c] += lame * volume;
    if (p.gap_memory) {
      // Closing that would raise pressure takes away gap instead.
      const Doubles gap = widen(&open.state[kGap][k]);
      const Doubles pressure_strain = (stress[0] + stress[1] + stress[2]) * -inverse_bulk_3;
      const Doubles least = smaller(smaller(gap, pressure_strain), -volume);
      const Doubles closed = select(least > 0.0, least, Doubles{});
      for (std::size_t c = 0; c < 3; ++c) stress[c] += p.bulk_modulus_pa * closed;
      store(&open.state[kGap][k], narrow(gap - closed));
    }
    const Doubles j1 = -(stress[0] + stress[1] + stress[2]);
    const Doubles pressure = j1 * (1.0 / 3.0);
    const Doubles xx = stress[0] + pressure, yy = stress[1] + pressure, zz = stress[2] + pressure;
    const Doubles s = squareRoot(0.5 * (xx * xx + yy * yy + zz * zz) +
                                 (stress[3] * stress[3] + stress[4] * stress[4] + stress[5] * stress[5]));
    const Doubles compaction = widen(&open.state[kCompaction][k]);
    const Mask finite = isFinite(j1 + s + compaction + integrity);

    const OldCap old = computeOldCap(p, compaction);
    const Cap cap = computeCap(p, compaction, old.compaction, old.logarithm);
    const Doubles resolution = kStressResolution * (p.alpha_pa + abs(j1));
    const Doubles cap_resolution = resolution + kCompactionResolution * larger(compaction, Doubles{}) * cap.hardening;
    const Doubles cone = p.alpha_pa + p.theta * j1 + resolution;
    const Doubles t = larger((j1 - cap_resolution - cap.start) * cap.inverse_width, Doubles{});
    const Mask elastic = (cone >= 0.0) & (s * s <= cone * cone * (1.0 - t * t));

    for (std::size_t c = 0; c < 6; ++c) store(&open.trial[c][k], stress[c]);
    store(&open.trial_j1[k], j1);
    store(&open.trial_s[k], s);
    store(&open.j1[k], j1);
    store(&open.s[k], s);
    store(&open.increment[k], Doubles{});
    store(&open.start[k], cap.start);
    store(&open.width[k], cap.width);
    store(&open.inverse_width[k], cap.inverse_width);
    store(&open.hardening[k], cap.hardening);
    store(&open.logarithm[k], old.logarithm);
    store(&open.inverse_rest[k], old.inverse_rest);
    store(&open.yields[k], finite & ~elastic);
    store(&open.left[k], ~finite);
  }
  std::size_t n = 0;
  for (std::size_t k = 0; k < count; ++k) {
    open.yielding[n] = static_cast<std::uint32_t>(k);
    n += static_cast<std::size_t>(open.yields[k] & 1);
  }
  return n;
}

struct Residual {
  Doubles value, slope, tolerance;
  Doubles j1, s;
  Doubles t, t_slope;
  Mask at_tip;
};

/// CapModel::computeResidual; away from the tip of the cap, value, slope and tolerance are those times sqrt(F_c), which
/// saves a division.
BRASH_ICE_INLINE Residual computeResidual(const CapConstants& p, Doubles increment, const Cap& cap, Doubles trial_j1,
                                          Doubles trial_s) {
  const double j1_slope = -3.0 * p.bulk_modulus_pa;
  const Doubles j1 = trial_j1 + j1_slope * increment;
  const Doubles cone = p.alpha_pa + p.theta * j1;
  const double cone_slope = j1_slope * p.theta;
  const Doubles width_slope = p.width_ratio * cap.hardening;
  const Doubles t = (j1 - cap.start) * cap.inverse_width;
  const Doubles t_slope = (j1_slope - (cap.hardening - width_slope) - t * width_slope) * cap.inverse_width;

  const Mask on_cap = t > 0.0;
  const Doubles cap_t = select(on_cap, t, Doubles{}), cap_t_slope = select(on_cap, t_slope, Doubles{});
  const Doubles shape = 1.0 - cap_t * cap_t;
  const Doubles shape_slope = -2.0 * cap_t * cap_t_slope;
  const Mask compacts = (increment > 0.0) | ((increment == 0.0) & (t > p.neutral));
  const Mask flows = (compacts & (t > p.neutral)) | (~compacts & (t < p.neutral));
  Doubles h = 2.0 * cap_t * (p.inverse_aspect_ratio + p.theta * cap_t);
  Doubles h_slope = (2.0 * p.inverse_aspect_ratio + 4.0 * p.theta * cap_t) * cap_t_slope;
  if (p.associated) {
    h -= (2.0 * p.theta) * shape;
    h_slope -= (2.0 * p.theta) * shape_slope;
  }
  h = select(flows, h, Doubles{});
  h_slope = select(flows, h_slope, Doubles{});
  const Mask at_neutral = ~flows & ~compacts;
  const Doubles f_c = select(at_neutral, splat(1.0 - p.neutral * p.neutral), shape);
  const Doubles f_c_slope = select(at_neutral, Doubles{}, shape_slope);

  const Doubles d = (2.0 * p.shear_modulus_pa) * increment + 3.0 * cone * h;
  const Doubles d_slope = (2.0 * p.shear_modulus_pa) + 3.0 * (cone_slope * h + cone * h_slope);
  const Doubles n = 3.0 * trial_s * h;
  const Doubles n_slope = 3.0 * trial_s * h_slope;
  const Mask at_tip = f_c < kTipOfCap;
  const Doubles root_of_shape = squareRoot(larger(shape, Doubles{}));
  const Doubles root = select(at_neutral, splat(__builtin_sqrt(1.0 - p.neutral * p.neutral)), root_of_shape);
  const Doubles sign = select(compacts, splat(1.0), splat(-1.0));
  Residual result;
  result.value = sign * (f_c * d - root * n);
  result.slope = sign * (f_c * d_slope + 0.5 * f_c_slope * d - root * n_slope);
  result.tolerance = kResidualTolerance * f_c * abs(d);
  if (any(at_tip)) {
    result.value = select(at_tip, f_c * d * d - n * n, result.value);
    result.slope = select(at_tip, f_c_slope * d * d + 2.0 * (f_c * d * d_slope - n * n_slope), result.slope);
    result.tolerance =
        select(at_tip, (kResidualTolerance * larger(f_c, Doubles{}) + kTipTolerance) * d * d, result.tolerance);
  }
  result.j1 = j1;
  result.s = cone * root_of_shape;
  result.t = t;
  result.t_slope = t_slope;
  result.at_tip = at_tip;
  return result;
}

/// The returns in progress, side by side; copies of the last one fill up the last group of lanes.
struct Returns {
  alignas(64) double trial_j1[kCapTile], trial_s[kCapTile];
  alignas(64) double compaction[kCapTile], logarithm[kCapTile], inverse_rest[kCapTile];
  alignas(64) double start[kCapTile], width[kCapTile], inverse_width[kCapTile], hardening[kCapTile];
  // The bracket of the increment, the increment, and the sizes of the last step and of the last one of Newton's.
  alignas(64) double outside[kCapTile], inside[kCapTile], increment[kCapTile];
  alignas(64) double last_step[kCapTile], newton_step[kCapTile];
  alignas(64) double j1[kCapTile], s[kCapTile];
  alignas(64) std::int64_t done[kCapTile];
};

BRASH_ICE_INLINE Cap loadCap(const Returns& at, std::size_t k) {
  return {load<Doubles>(&at.start[k]), load<Doubles>(&at.width[k]), load<Doubles>(&at.inverse_width[k]),
          load<Doubles>(&at.hardening[k])};
}

BRASH_ICE_INLINE void storeCap(Returns& at, std::size_t k, const Cap& cap) {
  store(&at.start[k], cap.start);
  store(&at.width[k], cap.width);
  store(&at.inverse_width[k], cap.inverse_width);
  store(&at.hardening[k], cap.hardening);
}

BRASH_ICE_INLINE OldCap loadOldCap(const CapConstants& p, const Returns& at, std::size_t k) {
  return {compactionOfEq12(p, load<Doubles>(&at.compaction[k])), load<Doubles>(&at.logarithm[k]),
          load<Doubles>(&at.inverse_rest[k])};
}

/// The explicit returns of CapModel::returnToSurface; for the others, where iterations begin.
/// @return whether a lane is not done
BRASH_ICE_INLINE bool beginReturn(const CapConstants& p, const Cap& virgin, Returns& at, std::size_t k) {
  const double bulk_3 = 3.0 * p.bulk_modulus_pa, inverse_bulk_3 = 1.0 / bulk_3;
  const Doubles j1 = load<Doubles>(&at.trial_j1[k]), s = load<Doubles>(&at.trial_s[k]);
  const Doubles compaction = load<Doubles>(&at.compaction[k]);
  const Cap cap = loadCap(at, k);
  const Doubles cone = p.alpha_pa + p.theta * j1;
  const Doubles to_apex = (j1 + p.apex_pa) * inverse_bulk_3;
  const Mask dilates = (j1 - cap.start) * cap.inverse_width <= p.neutral;
  Doubles outside = Doubles{}, first = Doubles{}, increment = Doubles{};
  const Doubles inside = (j1 - (cap.start + p.neutral * cap.width)) * inverse_bulk_3;
  Mask at_apex, on_cone;
  if (p.associated) {
    // On the cone alone the answer is explicit.
    const double compliance = -3.0 * p.theta / (p.shear_modulus_pa + 3.0 * bulk_3 * p.theta * p.theta);
    increment = compliance * (s - cone);
    const Doubles end = j1 - bulk_3 * increment;
    const Mask on_its_way = dilates & (increment < 0.0);
    at_apex = on_its_way & (p.alpha_pa + p.theta * end <= 0.0);
    outside = select(dilates, smaller(to_apex, Doubles{}), Doubles{});
    const Mask usable = dilates & (increment > inside) & (increment < outside);
    first = select(usable, increment, outside);
    const Cap moved = moveCap(p, virgin, loadOldCap(p, at, k), compaction + select(on_its_way, increment, first));
    on_cone = on_its_way & (end <= moved.start);
    storeCap(at, k, select(dilates, moved, cap));
  } else {
    at_apex = dilates & (cone <= 0.0);
    on_cone = dilates;
  }
  const Doubles end = j1 - bulk_3 * increment;
  const Mask done = at_apex | on_cone;
  store(&at.outside[k], outside);
  store(&at.inside[k], inside);
  store(&at.increment[k], select(at_apex, to_apex, select(on_cone, increment, first)));
  store(&at.last_step[k], abs(inside - outside));
  store(&at.newton_step[k], Doubles{});
  store(&at.j1[k], select(at_apex, splat(-p.apex_pa), end));
  store(&at.s[k], select(at_apex, Doubles{}, p.alpha_pa + p.theta * end));
  store(&at.done[k], done);
  return any(~done);
}

/// One step of Newton's method inside the bracket, as in CapModel::returnToSurface, which takes one step more to see
/// that it has arrived. Here the last step is made along the slopes at hand, where two steps in a row tell that what
/// is left after it, in proportion to |step|³ / |last step|², cannot be seen.
/// @return whether a lane is not done
BRASH_ICE_INLINE bool iterateOnce(const CapConstants& p, Returns& at, std::size_t k, bool may_step) {
  const double j1_slope = -3.0 * p.bulk_modulus_pa;
  const Mask was_done = load<Mask>(&at.done[k]);
  const Doubles trial_j1 = load<Doubles>(&at.trial_j1[k]), trial_s = load<Doubles>(&at.trial_s[k]);
  const Doubles x = load<Doubles>(&at.increment[k]);
  const Residual residual = computeResidual(p, x, loadCap(at, k), trial_j1, trial_s);
  const Mask is_outside = residual.value < 0.0;
  const Doubles outside = select(is_outside, x, load<Doubles>(&at.outside[k]));
  const Doubles inside = select(is_outside, load<Doubles>(&at.inside[k]), x);
  const Doubles size = (abs(trial_j1) + p.alpha_pa) * (1.0 / -j1_slope) + larger(abs(inside), abs(outside));
  const Mask arrived =
      (abs(residual.value) <= residual.tolerance) | (abs(inside - outside) <= kBracketTolerance * size);
  store(&at.outside[k], outside);
  store(&at.inside[k], inside);

  const Doubles newton = x - residual.value / residual.slope;
  const Doubles step = newton - x, step_size = abs(step);
  Mask usable = ((newton - outside) * (newton - inside) < 0.0) & (step_size <= 0.5 * load<Doubles>(&at.last_step[k]));
  if (!may_step) usable = Mask{};
  const Doubles next = select(usable, newton, 0.5 * (outside + inside));

  // Per increment, the change of t, that of J1 in its own size, and that of the hardening.
  const Doubles rate = larger(larger(abs(residual.t_slope), -j1_slope / (p.alpha_pa + abs(residual.j1))),
                              load<Doubles>(&at.inverse_rest[k]));
  const Doubles last = load<Doubles>(&at.newton_step[k]);
  const Doubles t = residual.t + residual.t_slope * step;
  const Mask same_side =
      (residual.t * t > 0.0) & ((residual.t - p.neutral) * (t - p.neutral) > 0.0) & (x * newton > 0.0);
  const Mask last_one = usable & ~residual.at_tip & same_side & (rate * step_size <= kLargestLastStep) &
                        (rate * step_size * (step_size * step_size) <= kLastError * (last * last));
  const Doubles j1 = residual.j1 + j1_slope * step;
  const Doubles cap_t = larger(t, Doubles{});
  const Doubles s = (p.alpha_pa + p.theta * j1) * squareRoot(1.0 - cap_t * cap_t);

  const Mask steps = ~arrived & last_one;
  const Mask done = was_done | arrived | last_one;
  store(&at.j1[k], select(was_done, load<Doubles>(&at.j1[k]), select(steps, j1, residual.j1)));
  store(&at.s[k], select(was_done, load<Doubles>(&at.s[k]), select(steps, s, residual.s)));
  store(&at.increment[k], select(was_done | arrived, x, next));
  store(&at.last_step[k], abs(next - x));
  store(&at.newton_step[k], select(usable, step_size, Doubles{}));
  store(&at.done[k], done);
  return any(~done);
}

/// CapModel::returnToSurface for those that yield. Each step is made for all groups of lanes that are not done before
/// the next: they do not wait for each other's results, and a step is a long chain of operations.
void returnToSurface(const CapConstants& p, Open& open, std::size_t count) {
  const Cap virgin = computeVirginCap(p);
  const std::size_t filled = roundUp(count);
  for (std::size_t k = count; k < filled; ++k) open.yielding[k] = open.yielding[count - 1];
  Returns at;
  const double* const from[] = {open.trial_j1, open.trial_s, open.logarithm,     open.inverse_rest,
                                open.start,    open.width,   open.inverse_width, open.hardening};
  double* const to[] = {at.trial_j1, at.trial_s, at.logarithm,     at.inverse_rest,
                        at.start,    at.width,   at.inverse_width, at.hardening};
  for (std::size_t a = 0; a < sizeof(to) / sizeof(to[0]); ++a) {
    for (std::size_t k = 0; k < filled; ++k) to[a][k] = from[a][open.yielding[k]];
  }
  for (std::size_t k = 0; k < filled; ++k) {
    at.compaction[k] = static_cast<double>(open.state[kCompaction][open.yielding[k]]);
  }

  Groups groups;
  for (std::size_t k = 0; k < filled; k += kWidth) groups.add(k, beginReturn(p, virgin, at, k));
  for (int i = 0; groups.count > 0; ++i) {
    Groups remaining;
    for (std::size_t g = 0; g < groups.count; ++g) {
      const std::size_t k = groups.begin[g];
      remaining.add(k, iterateOnce(p, at, k, i <= kMaxNewtonSteps));
    }
    groups = remaining;
    if (i == kMaxIterations) break;
    for (std::size_t g = 0; g < groups.count; ++g) {
      const std::size_t k = groups.begin[g];
      storeCap(
          at, k,
          moveCap(p, virgin, loadOldCap(p, at, k), load<Doubles>(&at.compaction[k]) + load<Doubles>(&at.increment[k])));
    }
  }

  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t end = open.yielding[k];
    open.j1[end] = at.j1[k];
    open.s[end] = at.trial_s[k] < at.s[k] ? at.trial_s[k] : at.s[k];
    open.increment[end] = at.increment[k];
    open.left[end] = ~at.done[k];
  }
}

// ------------------------------------------------------------------------------------------------ after the return

BRASH_ICE_INLINE void loadTensor(const double (*from)[kCapTile], std::size_t k, Doubles* to) {
  for (std::size_t c = 0; c < 6; ++c) to[c] = load<Doubles>(&from[c][k]);
}

/// The rest of CapModel::updateParticle but for damage. The undamaged stress takes the place of the trial.
BRASH_ICE_INLINE void settle(const CapConstants& p, Open& open, std::size_t k) {
  const Doubles trial_j1 = load<Doubles>(&open.trial_j1[k]), trial_s = load<Doubles>(&open.trial_s[k]);
  const Doubles j1 = load<Doubles>(&open.j1[k]), s = load<Doubles>(&open.s[k]);
  const Doubles increment = load<Doubles>(&open.increment[k]);
  const Mask yields = load<Mask>(&open.yields[k]);
  const Doubles shrink = select(trial_s > 0.0, s / trial_s, Doubles{});
  for (std::size_t c = 0; c < 6; ++c) {
    const Doubles trial = load<Doubles>(&open.trial[c][k]);
    const Doubles deviator = c < 3 ? trial + trial_j1 * (1.0 / 3.0) : trial;
    const Doubles stress = c < 3 ? shrink * deviator - j1 * (1.0 / 3.0) : shrink * deviator;
    store(&open.trial[c][k], select(yields, stress, trial));
  }
  const Doubles compaction = widen(&open.state[kCompaction][k]);
  store(&open.state[kCompaction][k], narrow(select(yields, larger(compaction + increment, Doubles{}), compaction)));
  const Doubles plastic_strain = widen(&open.state[kPlasticStrain][k]);
  const double inverse_shear = 1.0 / (kRootOfThree * p.shear_modulus_pa);
  store(&open.state[kPlasticStrain][k], narrow(plastic_strain + (trial_s - s) * inverse_shear));
  if (p.gap_memory) {
    const Doubles gap = widen(&open.state[kGap][k]);
    store(&open.state[kGap][k], narrow(select((increment < 0.0) & (j1 <= 0.0), gap - increment, gap)));
  }
}

// The stages of CapModel::degradeStress.

/// Total strain, regime, and the measure of ductile damage.
/// @return whether a lane is in tension
BRASH_ICE_INLINE bool measureDuctile(const CapConstants& p, Open& open, std::size_t k) {
  const Doubles j1 = load<Doubles>(&open.j1[k]);
  Doubles undamaged[6];
  loadTensor(open.trial, k, undamaged);
  // The part of the elastic strain that is there only because the modulus is scaled.
  const double excess = 1.0 - p.stiffness_scale;
  const double excess_shear = 0.5 * excess / p.shear_modulus_pa;
  const Doubles excess_volume = j1 * (excess_shear / 3.0 - excess / (9.0 * p.bulk_modulus_pa));
  Doubles normal{}, shear{};  // parts of stress : strain
  for (std::size_t c = 0; c < 6; ++c) {
    float* const total = &open.state[kTotalStrain + c][k];
    const Floats sum = narrow(widen(total) + widen(&open.strain[c][k]));
    store(total, sum);
    Doubles e = widen(sum) - excess_shear * undamaged[c];
    if (c < 3) e -= excess_volume;
    store(&open.strain_of_damage[c][k], e);
    (c < 3 ? normal : shear) += undamaged[c] * e;
  }
  // A crack that is still open carries no shear either.
  Mask tensile = j1 < 0.0;
  if (p.gap_memory) tensile |= widen(&open.state[kGap][k]) > 0.0;
  store(&open.tensile[k], tensile);
  store(&open.measure[k], squareRoot(larger(0.5 * normal + shear, Doubles{})));
  return any(tensile);
}

/// The measure of brittle damage.
BRASH_ICE_INLINE void measureBrittle(const CapConstants& p, Open& open, std::size_t k) {
  Doubles strain[6];
  loadTensor(open.strain_of_damage, k, strain);
  const Doubles measure = p.root_elastic * computeLargestPrincipal(strain);
  store(&open.measure[k], select(load<Mask>(&open.tensile[k]), measure, load<Doubles>(&open.measure[k])));
}

/// Thresholds of the regime that each particle is in.
/// @return whether damage may grow in a lane
BRASH_ICE_INLINE bool compareWithThreshold(Open& open, std::size_t k) {
  const Mask tensile = load<Mask>(&open.tensile[k]);
  const Mask shears = load<Mask>(&open.yields[k]) & (load<Doubles>(&open.increment[k]) <= 0.0);
  const Doubles measure = load<Doubles>(&open.measure[k]);
  const Doubles brittle = widen(&open.state[kBrittleThreshold][k]), ductile = widen(&open.state[kDuctileThreshold][k]);
  Doubles threshold = select(tensile, brittle, ductile);
  const Doubles met = select(measure != 0.0, measure, splat(1e-30));
  threshold = select(shears & (threshold == 0.0), asFloat(met), threshold);
  store(&open.state[kBrittleThreshold][k], narrow(select(tensile, threshold, brittle)));
  store(&open.state[kDuctileThreshold][k], narrow(select(tensile, ductile, threshold)));
  const Mask grows = (threshold != 0.0) & (measure - threshold > 0.0);
  store(&open.threshold[k], threshold);
  store(&open.grows[k], grows);
  store(&open.left[k], load<Mask>(&open.left[k]) | ~isFinite(measure));
  return any(grows);
}

BRASH_ICE_INLINE void findStrongest(Open& open, std::size_t k) {
  Doubles undamaged[6];
  loadTensor(open.trial, k, undamaged);
  store(&open.strongest[k], computeLargestPrincipal(undamaged));
}

/// Damage grows, but not by what float cannot resolve, or rest would creep.
BRASH_ICE_INLINE void raise(float* damage, Mask grows, Doubles value) {
  const Doubles old = widen(damage);
  store(damage, narrow(select(grows & (value > old + kDamageResolution), value, old)));
}

BRASH_ICE_INLINE void growDamage(const CapConstants& p, Open& open, std::size_t k) {
  const Doubles j1 = load<Doubles>(&open.j1[k]), s = load<Doubles>(&open.s[k]);
  const Mask tensile = load<Mask>(&open.tensile[k]), grows = load<Mask>(&open.grows[k]);
  const Doubles threshold = load<Doubles>(&open.threshold[k]);
  const Doubles growth = load<Doubles>(&open.measure[k]) - threshold;
  // Softening::fractureEnergy.
  const Doubles deviatoric = kRootOfThree * s, size = abs(j1);
  const Doubles ratio = select(size >= deviatoric, splat(1.0), size / deviatoric);
  const Doubles square = ratio * ratio;
  const double shear = p.fracture_energy_shear_jpm2;
  const Doubles energy = shear + select(j1 <= 0.0, ratio * (p.fracture_energy_tension_jpm2 - shear),
                                        square * square * ratio * (p.fracture_energy_compression_jpm2 - shear));
  const Doubles energy_per_length = energy * (1.0 / p.element_length_m);
  // Softening::ductileRate, brittleRate and maxDuctileDamage; rates are times the energy.
  const Doubles linear = threshold * p.ductile_log;
  const Doubles ductile_rate = 2.0 * (linear + squareRoot(linear * linear + p.ductile_dilog * energy_per_length));
  const Doubles brittle_rate = load<Doubles>(&open.strongest[k]) * (p.brittle_log / p.root_elastic);
  const Doubles confined = select(deviatoric >= j1, splat(1.0), deviatoric / j1);
  const Doubles limit =
      select(tensile, splat(p.max_damage), smaller(splat(p.max_damage), confined * squareRoot(confined)));
  const Doubles rate = select(tensile, brittle_rate, ductile_rate);
  const Doubles shape = select(tensile, splat(p.brittle_shape), splat(p.ductile_shape));
  const Doubles decay = computeExp(-growth * rate / energy_per_length);
  const Doubles value = limit * (1.0 - decay) / (1.0 + shape * decay);
  raise(&open.state[kBrittleDamage][k], grows & tensile, value);
  raise(&open.state[kDuctileDamage][k], grows & ~tensile, value);
}

BRASH_ICE_INLINE void applyDamage(Open& open, std::size_t k) {
  const Doubles brittle = widen(&open.state[kBrittleDamage][k]), ductile = widen(&open.state[kDuctileDamage][k]);
  const Doubles applied = select(load<Mask>(&open.tensile[k]), larger(brittle, ductile), ductile);
  store(&open.state[kDamage][k], narrow(applied));
  for (std::size_t c = 0; c < 6; ++c) {
    const Doubles stress = load<Doubles>(&open.trial[c][k]) * (1.0 - applied);
    store(&open.stress[c][k], narrow(stress));
  }
}

/// From the returned invariants to new stress and state, stage by stage for all groups (see returnToSurface).
/// @return whether any particle is left
bool finish(const CapConstants& p, Open& open, std::size_t count) {
  for (std::size_t k = 0; k < count; k += kWidth) settle(p, open, k);
  if (p.damages) {
    Groups tensile, growing;
    for (std::size_t k = 0; k < count; k += kWidth) tensile.add(k, measureDuctile(p, open, k));
    for (std::size_t g = 0; g < tensile.count; ++g) measureBrittle(p, open, tensile.begin[g]);
    for (std::size_t k = 0; k < count; k += kWidth) growing.add(k, compareWithThreshold(open, k));
    for (std::size_t g = 0; g < growing.count; ++g) {
      const std::size_t k = growing.begin[g];
      const Mask needed = load<Mask>(&open.tensile[k]) & load<Mask>(&open.grows[k]);
      if (any(needed)) findStrongest(open, k);
    }
    for (std::size_t g = 0; g < growing.count; ++g) growDamage(p, open, growing.begin[g]);
    for (std::size_t k = 0; k < count; k += kWidth) applyDamage(open, k);
  } else {
    for (std::size_t k = 0; k < count; k += kWidth) {
      for (std::size_t c = 0; c < 6; ++c) store(&open.stress[c][k], narrow(load<Doubles>(&open.trial[c][k])));
    }
  }
  Mask any_left{};
  for (std::size_t k = 0; k < count; k += kWidth) any_left |= load<Mask>(&open.left[k]);
  return any(any_left);
}

/// Copies the open values of an array side by side, and repeats the last one up to a full group of lanes.
BRASH_ICE_INLINE void collect(const OpenList& open, std::size_t filled, const float* from, float* to) {
#if defined(__AVX512F__)
  std::size_t n = 0;
  for (std::size_t i = 0; i < kCapTile; i += 16) {
    const auto bits = static_cast<__mmask16>(open.bits[i / 64] >> (i % 64));
    if (bits == 0) continue;
    _mm512_storeu_ps(to + n, _mm512_maskz_compress_ps(bits, _mm512_maskz_loadu_ps(bits, from + i)));
    n += static_cast<std::size_t>(__builtin_popcount(bits));
  }
  for (; n < filled; ++n) to[n] = to[open.count - 1];
#else
  for (std::size_t k = 0; k < filled; ++k) to[k] = from[open.index[k]];
#endif
}

/// Copies them back.
BRASH_ICE_INLINE void distribute(const OpenList& open, const float* from, float* to) {
#if defined(__AVX512F__)
  std::size_t n = 0;
  for (std::size_t i = 0; i < kCapTile; i += 16) {
    const auto bits = static_cast<__mmask16>(open.bits[i / 64] >> (i % 64));
    if (bits == 0) continue;
    _mm512_mask_storeu_ps(to + i, bits, _mm512_maskz_expand_ps(bits, _mm512_loadu_ps(from + n)));
    n += static_cast<std::size_t>(__builtin_popcount(bits));
  }
#else
  for (std::size_t k = 0; k < open.count; ++k) to[open.index[k]] = from[k];
#endif
}

std::size_t update(const CapConstants& constants, const CapBatch& batch, std::size_t begin, std::size_t count,
                   std::uint32_t* left) {
  Arrays arrays{};
  for (std::size_t c = 0; c < 6; ++c) {
    arrays.strain[c] = batch.strain_increment[c] + begin;
    arrays.stress[c] = batch.stress[c] + begin;
  }
  for (std::size_t i = 0; i < kCapStates; ++i) {
    if (batch.state[i] != nullptr) arrays.state[i] = batch.state[i] + begin;
  }
  OpenList list;
  updateElastic(constants, arrays, count, list);
  if (constants.leaves_yielding) {
    for (std::size_t k = 0; k < list.count; ++k) left[k] = list.index[k];
    return list.count;
  }
  if (list.count == 0) return 0;

  const std::size_t filled = roundUp(list.count);
  for (std::size_t k = list.count; k < filled; ++k) list.index[k] = list.index[list.count - 1];
  Open open;
  for (std::size_t c = 0; c < 6; ++c) {
    collect(list, filled, arrays.strain[c], open.strain[c]);
    collect(list, filled, arrays.stress[c], open.stress[c]);
  }
  for (std::size_t i = 0; i < kCapStates; ++i) {
    if (arrays.state[i] != nullptr) collect(list, filled, arrays.state[i], open.state[i]);
  }
  const std::size_t yielding = predict(constants, open, filled);
  if (yielding > 0) returnToSurface(constants, open, yielding);
  std::size_t left_count = 0;
  if (finish(constants, open, filled)) {
    for (std::size_t k = 0; k < list.count; ++k) {
      if (open.left[k] == 0) continue;
      // Its old values go back.
      left[left_count++] = list.index[k];
      for (std::size_t c = 0; c < 6; ++c) open.stress[c][k] = arrays.stress[c][list.index[k]];
      for (std::size_t i = 0; i < kCapStates; ++i) {
        if (arrays.state[i] != nullptr) open.state[i][k] = arrays.state[i][list.index[k]];
      }
    }
  }
  for (std::size_t c = 0; c < 6; ++c) distribute(list, open.stress[c], arrays.stress[c]);
  for (std::size_t i = 0; i < kCapStates; ++i) {
    if (arrays.state[i] != nullptr) distribute(list, open.state[i], arrays.state[i]);
  }
  return left_count;
}

// ---------------------------------------------------------------------------------------------------------- for tests

template <class Function>
void forEach(const double* const* inputs, std::size_t input_count, double* result, std::size_t count,
             const Function& function) {
  for (std::size_t k = 0; k < count; k += kWidth) {
    Doubles lanes[6] = {};
    const std::size_t n = count - k < kWidth ? count - k : kWidth;
    for (std::size_t j = 0; j < input_count; ++j) {
      for (std::size_t i = 0; i < n; ++i) lanes[j][i] = inputs[j][k + i];
    }
    const Doubles values = function(lanes);
    for (std::size_t i = 0; i < n; ++i) result[k + i] = values[i];
  }
}

void computeLogs(const double* x, double* result, std::size_t count) {
  forEach(&x, 1, result, count, [](const Doubles* lanes) { return computeLog(lanes[0]); });
}

void computeExps(const double* x, double* result, std::size_t count) {
  forEach(&x, 1, result, count, [](const Doubles* lanes) { return computeExp(lanes[0]); });
}

void computeLargestPrincipals(const double* const* tensors, double* result, std::size_t count) {
  forEach(tensors, 6, result, count, [](const Doubles* lanes) { return computeLargestPrincipal(lanes); });
}

}  // namespace

extern const CapKernels BRASH_ICE_NAME_OF_SET(kCapKernels_);
const CapKernels BRASH_ICE_NAME_OF_SET(kCapKernels_) = {update, computeLogs, computeExps, computeLargestPrincipals};

}  // namespace brash_ice_rig
