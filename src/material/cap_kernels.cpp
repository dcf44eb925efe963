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
typedef double Doubles __attribute__((vector_size(8 * kWidth)));
typedef float Floats __attribute__((vector_size(4 * kWidth)));
typedef std::int64_t Mask __attribute__((vector_size(8 * kWidth)));  // all bits of a lane are set, or none
typedef std::uint64_t Bits __attribute__((vector_size(8 * kWidth)));

#define BRASH_ICE_INLINE inline __attribute__((always_inline))

constexpr double kStressResolution = 5e-7;      // as in cap_model.cpp
constexpr double kCompactionResolution = 7e-8;  //
constexpr double kDamageResolution = 2e-7;      //
constexpr double kMaxDamage = static_cast<double>(0.999f);
constexpr double kTipOfCap = 0.1;
constexpr double kResidualTolerance = 1e-9;
constexpr double kTipTolerance = 1e-14;
constexpr double kBracketTolerance = 1e-14;
constexpr int kMaxNewtonSteps = 30;
constexpr int kMaxIterations = 60;  // a return that takes more is left
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

BRASH_ICE_INLINE Doubles widen(Floats value) {
#if defined(__AVX512F__)
  return _mm512_maskz_cvtps_pd(0xff, value);
#elif defined(__AVX2__)
  return _mm256_cvtps_pd(value);
#else
  return Doubles{static_cast<double>(value[0]), static_cast<double>(value[1])};
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
#else
  return Floats{static_cast<float>(value[0]), static_cast<float>(value[1])};
#endif
}
BRASH_ICE_INLINE Doubles asFloat(Doubles value) {
  return widen(narrow(value));
}

BRASH_ICE_INLINE Mask isFinite(Doubles x) {
  return x - x == 0.0;
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
  // To 3e-13.
  constexpr double kCoefficients[] = {0.50000000000028455,     0.57735026907784848,   -0.11111110376460023,
                                      0.053458166293177303,    -0.032919165080023211, 0.022846167992015432,
                                      -0.016948570564984736,   0.01290260445724125,   -0.0095460400967022924,
                                      0.0063618329935697729,   -0.00348452270319465,  0.0014109963756484363,
                                      -0.00036524209825288765, 4.4607118125586219e-05};
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

/// Elastic predictor in float, and a check with a lower bound of the cap's intercept that needs no logarithm; since the
/// surface grows with X, what it calls elastic is elastic.
/// @param open  receives the distance from `begin` of the particles that this does not settle
/// @return how many those are
std::size_t updateElastic(const CapConstants& p, const CapBatch& batch, std::size_t begin, std::size_t count,
                          std::uint32_t* open) {
  const float shear_2 = static_cast<float>(2.0 * p.shear_modulus_pa);
  const float lame = static_cast<float>(p.bulk_modulus_pa - 2.0 / 3.0 * p.shear_modulus_pa);
  const float alpha = static_cast<float>(p.alpha_pa), theta = static_cast<float>(p.theta);
  const float apex = static_cast<float>(p.apex_pa);
  const float inverse_width_ratio = static_cast<float>(1.0 / p.width_ratio);
  const float initial_intercept = static_cast<float>(p.initial_intercept_pa * (1.0 - 1e-5));
  const float inverse_max_compaction = static_cast<float>((1.0 - 1e-5) / p.max_compaction);
  const float d1 = static_cast<float>(p.d1_per_pa), d2_per_d1 = static_cast<float>(p.d2_per_pa2 / p.d1_per_pa);
  const float factor_2 = static_cast<float>(p.smallest_lode_factor * p.smallest_lode_factor);

  static const float kNothing[kCapTile] = {};
  const float* strain[6];
  float* stress[6];
  for (std::size_t c = 0; c < 6; ++c) {
    strain[c] = batch.strain_increment[c] + begin;
    stress[c] = batch.stress[c] + begin;
  }
  const float* compaction = batch.state[kCompaction] + begin;
  const float* gap = p.gap_memory ? batch.state[kGap] + begin : kNothing;
  // Where a threshold is set, damage may grow without yielding.
  const float* brittle_threshold = p.damages ? batch.state[kBrittleThreshold] + begin : kNothing;
  const float* ductile_threshold = p.damages ? batch.state[kDuctileThreshold] + begin : kNothing;

  float predicted[6][kCapTile];
  std::int32_t is_open[kCapTile];
  for (std::size_t i = 0; i < count; ++i) {
    const float volume_part = lame * (strain[0][i] + strain[1][i] + strain[2][i]);
    const float xx = stress[0][i] + (shear_2 * strain[0][i] + volume_part);
    const float yy = stress[1][i] + (shear_2 * strain[1][i] + volume_part);
    const float zz = stress[2][i] + (shear_2 * strain[2][i] + volume_part);
    const float xy = stress[3][i] + shear_2 * strain[3][i];
    const float yz = stress[4][i] + shear_2 * strain[4][i];
    const float zx = stress[5][i] + shear_2 * strain[5][i];
    const float j1 = -(xx + yy + zz);
    const float dx = xx + j1 * (1.0f / 3.0f), dy = yy + j1 * (1.0f / 3.0f), dz = zz + j1 * (1.0f / 3.0f);
    const float j2 = 0.5f * (dx * dx + dy * dy + dz * dz) + (xy * xy + yz * yz + zx * zx);

    // -ln(1 - u) > u (6 - u) / (6 - 4 u) on (0, 1), and y > l / (D1 + D2 l / D1) for the root y of eq. 12.
    const float scaled = compaction[i] * inverse_max_compaction;
    const float u = scaled > 1.0f ? 1.0f : scaled < 0.0f ? 0.0f : scaled;
    const float numerator = u * (6.0f - u);
    const float intercept = initial_intercept + numerator / ((6.0f - 4.0f * u) * d1 + d2_per_d1 * numerator);
    const float raw_t = 1.0f - (intercept - j1) * inverse_width_ratio / (intercept + apex);
    const float t = raw_t < 0.0f ? 0.0f : raw_t;
    const float cone = alpha + theta * j1;
    const float opening = strain[0][i] + strain[1][i] + strain[2][i];
    const bool plain = ((gap[i] == 0.0f) | (j1 <= 0.0f) | (opening >= 0.0f)) & (brittle_threshold[i] == 0.0f) &
                       (ductile_threshold[i] == 0.0f);
    const bool elastic = plain & (cone >= 0.0f) & (j2 <= factor_2 * (cone * cone) * (1.0f - t * t));

    predicted[0][i] = elastic ? xx : stress[0][i];
    predicted[1][i] = elastic ? yy : stress[1][i];
    predicted[2][i] = elastic ? zz : stress[2][i];
    predicted[3][i] = elastic ? xy : stress[3][i];
    predicted[4][i] = elastic ? yz : stress[4][i];
    predicted[5][i] = elastic ? zx : stress[5][i];
    is_open[i] = elastic ? 0 : 1;
  }
  for (std::size_t c = 0; c < 6; ++c) __builtin_memcpy(stress[c], predicted[c], count * sizeof(float));
  if (p.damages) {
    for (std::size_t c = 0; c < 6; ++c) {
      float* total = batch.state[kTotalStrain + c] + begin;
      for (std::size_t i = 0; i < count; ++i) total[i] += is_open[i] == 0 ? strain[c][i] : 0.0f;
    }
  }
  std::size_t n = 0;
  for (std::size_t i = 0; i < count; ++i) {
    open[n] = static_cast<std::uint32_t>(i);
    n += static_cast<std::size_t>(is_open[i]);
  }
  return n;
}

// ------------------------------------------------------------------------------------------------ return of open ones

/// The open particles of a tile, side by side. Copies of the last one fill up the last group of lanes.
struct Open {
  // In and out.
  alignas(64) float strain[6][kCapTile];
  alignas(64) float stress[6][kCapTile];
  alignas(64) float state[kCapStates][kCapTile];
  // Between the stages: the trial and the point that it returns to, undamaged.
  alignas(64) double trial[6][kCapTile];
  alignas(64) double trial_j1[kCapTile], trial_s[kCapTile];
  alignas(64) double j1[kCapTile], s[kCapTile];
  alignas(64) double increment[kCapTile];  // plastic compaction of this step
  alignas(64) std::int64_t yields[kCapTile];
  alignas(64) std::int64_t left[kCapTile];
  // Where iterations begin: the bracket of the increment, the first one and its cap.
  alignas(64) double outside[kCapTile], inside[kCapTile], first[kCapTile];
  alignas(64) double first_start[kCapTile], first_width[kCapTile], first_inverse_width[kCapTile],
      first_hardening[kCapTile];
  alignas(64) double logarithm[kCapTile], inverse_rest[kCapTile];  // of the old cap
  // Which ones those are.
  std::uint32_t iterating[kCapTile];
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
  return {e, computeLogarithm(p, e), 1.0 / (p.max_compaction - e)};
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

/// A cap not far from the old one, whose logarithm needs only a short sum.
BRASH_ICE_INLINE Cap moveCap(const CapConstants& p, const OldCap& old, Doubles compaction) {
  const Doubles e = compactionOfEq12(p, compaction);
  const Doubles ratio = (old.compaction - e) * old.inverse_rest;
  Doubles logarithm = old.logarithm - computeLogNearOne(ratio);
  const Mask far = abs(ratio) > 0x1p-5;
  if (any(far)) logarithm = select(far, computeLogarithm(p, e), logarithm);
  return computeCap(p, compaction, e, logarithm);
}

/// CapModel::isElastic, elastic predictor and explicit returns. Sets out which particles need iterations.
/// @return how many those are
std::size_t predict(const CapConstants& p, Open& open, std::size_t count) {
  const double bulk_3 = 3.0 * p.bulk_modulus_pa, inverse_bulk_3 = 1.0 / bulk_3;
  const double lame = p.bulk_modulus_pa - 2.0 / 3.0 * p.shear_modulus_pa;
  const double cone_compliance = -3.0 * p.theta / (p.shear_modulus_pa + 3.0 * bulk_3 * p.theta * p.theta);
  alignas(64) std::int64_t iterates[kCapTile];
  for (std::size_t k = 0; k < count; k += kWidth) {
    Doubles strain[6], stress[6];
    Doubles integrity = splat(1.0);
    if (p.damages) integrity = 1.0 - smaller(widen(&open.state[kDamage][k]), splat(kMaxDamage));
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
      const Mask closes = least > 0.0;
      const Doubles closed = select(closes, least, Doubles{});
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
    const Doubles cone = p.alpha_pa + p.theta * j1;
    const Doubles resolution = kStressResolution * (p.alpha_pa + abs(j1));
    const Doubles cap_resolution = resolution + kCompactionResolution * larger(compaction, Doubles{}) * cap.hardening;
    const Doubles widened_cone = cone + resolution;
    const Doubles resolved_t = larger((j1 - cap_resolution - cap.start) * cap.inverse_width, Doubles{});
    const Mask elastic =
        (widened_cone >= 0.0) & (s * s <= widened_cone * widened_cone * (1.0 - resolved_t * resolved_t));
    const Mask yields = finite & ~elastic;

    const Doubles to_apex = (j1 + p.apex_pa) * inverse_bulk_3;
    const Mask dilates = (j1 - cap.start) * cap.inverse_width <= p.neutral;
    Doubles outside = Doubles{}, first = Doubles{}, increment = Doubles{};
    const Doubles inside = (j1 - (cap.start + p.neutral * cap.width)) * inverse_bulk_3;
    Cap first_cap = cap;
    Mask at_apex, on_cone;
    if (p.associated) {
      // On the cone alone the answer is explicit.
      const Doubles step = cone_compliance * (s - cone);
      const Doubles end = j1 - bulk_3 * step;
      at_apex = dilates & (step < 0.0) & (p.alpha_pa + p.theta * end <= 0.0);
      const Cap moved = moveCap(p, old, compaction + step);
      on_cone = dilates & (step < 0.0) & (end <= moved.start);
      increment = step;
      outside = select(dilates, smaller(to_apex, Doubles{}), Doubles{});
      const Mask usable = dilates & (step > inside) & (step < outside);
      first = select(usable, step, outside);
      first_cap = select(usable, moved, cap);
      const Mask beyond_apex = yields & ~usable & (outside < 0.0);
      if (any(beyond_apex)) first_cap = select(beyond_apex, moveCap(p, old, compaction + first), first_cap);
    } else {
      at_apex = dilates & (cone <= 0.0);
      on_cone = dilates;
    }
    const Doubles end = j1 - bulk_3 * increment;
    const Doubles end_j1 = select(at_apex, splat(-p.apex_pa), end);
    const Doubles end_s = select(at_apex, Doubles{}, smaller(s, p.alpha_pa + p.theta * end));
    for (std::size_t c = 0; c < 6; ++c) store(&open.trial[c][k], stress[c]);
    store(&open.trial_j1[k], j1);
    store(&open.trial_s[k], s);
    store(&open.j1[k], select(yields, end_j1, j1));
    store(&open.s[k], select(yields, end_s, s));
    store(&open.increment[k], select(yields, select(at_apex, to_apex, increment), Doubles{}));
    store(&open.outside[k], outside);
    store(&open.inside[k], inside);
    store(&open.first[k], first);
    store(&open.first_start[k], first_cap.start);
    store(&open.first_width[k], first_cap.width);
    store(&open.first_inverse_width[k], first_cap.inverse_width);
    store(&open.first_hardening[k], first_cap.hardening);
    store(&open.logarithm[k], old.logarithm);
    store(&open.inverse_rest[k], old.inverse_rest);
    store(&open.yields[k], yields);
    store(&open.left[k], ~finite);
    store(&iterates[k], yields & ~(at_apex | on_cone) & 1);
  }
  std::size_t n = 0;
  for (std::size_t k = 0; k < count; ++k) {
    open.iterating[n] = static_cast<std::uint32_t>(k);
    n += static_cast<std::size_t>(iterates[k]);
  }
  return n;
}

struct Residual {
  Doubles value, slope, tolerance;
  Doubles j1, s;
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
  return result;
}

/// The returns in progress, side by side; copies of the last one fill up the last group of lanes.
struct Iteration {
  alignas(64) double trial_j1[kCapTile], trial_s[kCapTile];
  alignas(64) double compaction[kCapTile], logarithm[kCapTile], inverse_rest[kCapTile];
  alignas(64) double outside[kCapTile], inside[kCapTile], increment[kCapTile], last_step[kCapTile];
  alignas(64) double start[kCapTile], width[kCapTile], inverse_width[kCapTile], hardening[kCapTile];
  alignas(64) double j1[kCapTile], s[kCapTile];
  alignas(64) std::int64_t done[kCapTile];
};

/// One step of Newton's method inside the bracket, as in CapModel::returnToSurface.
/// @return whether a lane is not done
BRASH_ICE_INLINE bool iterateOnce(const CapConstants& p, Iteration& at, std::size_t k, bool may_step) {
  const Doubles trial_j1 = load<Doubles>(&at.trial_j1[k]), trial_s = load<Doubles>(&at.trial_s[k]);
  const Doubles x = load<Doubles>(&at.increment[k]);
  const Cap cap{load<Doubles>(&at.start[k]), load<Doubles>(&at.width[k]), load<Doubles>(&at.inverse_width[k]),
                load<Doubles>(&at.hardening[k])};
  const Residual residual = computeResidual(p, x, cap, trial_j1, trial_s);
  const Mask is_outside = residual.value < 0.0;
  const Doubles outside = select(is_outside, x, load<Doubles>(&at.outside[k]));
  const Doubles inside = select(is_outside, load<Doubles>(&at.inside[k]), x);
  const Doubles size =
      (abs(trial_j1) + p.alpha_pa) * (1.0 / (3.0 * p.bulk_modulus_pa)) + larger(abs(inside), abs(outside));
  const Mask done = (abs(residual.value) <= residual.tolerance) | (abs(inside - outside) <= kBracketTolerance * size);
  store(&at.outside[k], outside);
  store(&at.inside[k], inside);
  store(&at.j1[k], residual.j1);
  store(&at.s[k], residual.s);
  store(&at.done[k], done);

  const Doubles newton = x - residual.value / residual.slope;
  const Mask usable =
      ((newton - outside) * (newton - inside) < 0.0) & (abs(newton - x) <= 0.5 * load<Doubles>(&at.last_step[k]));
  Doubles next = 0.5 * (outside + inside);
  if (may_step) next = select(usable, newton, next);
  store(&at.last_step[k], abs(next - x));
  store(&at.increment[k], select(done, x, next));  // a lane that is done keeps its x, and so its residual
  return any(~done);
}

/// The caps at the new increments.
BRASH_ICE_INLINE void moveCaps(const CapConstants& p, Iteration& at, std::size_t k) {
  const Doubles compaction = load<Doubles>(&at.compaction[k]);
  const OldCap old{compactionOfEq12(p, compaction), load<Doubles>(&at.logarithm[k]),
                   load<Doubles>(&at.inverse_rest[k])};
  const Mask done = load<Mask>(&at.done[k]);
  const Cap moved = moveCap(p, old, compaction + load<Doubles>(&at.increment[k]));
  store(&at.start[k], select(done, load<Doubles>(&at.start[k]), moved.start));
  store(&at.width[k], select(done, load<Doubles>(&at.width[k]), moved.width));
  store(&at.inverse_width[k], select(done, load<Doubles>(&at.inverse_width[k]), moved.inverse_width));
  store(&at.hardening[k], select(done, load<Doubles>(&at.hardening[k]), moved.hardening));
}

/// CapModel::returnToSurface where it needs Newton's method. Each step is made for all groups of lanes that are not
/// done before the next: they do not wait for each other's results, and a step is a long chain of operations.
void iterate(const CapConstants& p, Open& open, std::size_t count) {
  const std::size_t filled = roundUp(count);
  for (std::size_t k = count; k < filled; ++k) open.iterating[k] = open.iterating[count - 1];
  Iteration at;
  const double* const from[] = {
      open.trial_j1, open.trial_s,     open.logarithm,   open.inverse_rest,        open.outside,        open.inside,
      open.first,    open.first_start, open.first_width, open.first_inverse_width, open.first_hardening};
  double* const to[] = {at.trial_j1,  at.trial_s, at.logarithm, at.inverse_rest,  at.outside,  at.inside,
                        at.increment, at.start,   at.width,     at.inverse_width, at.hardening};
  for (std::size_t k = 0; k < filled; k += kWidth) {
    const std::uint32_t* const index = &open.iterating[k];
    if (index[kWidth - 1] - index[0] == kWidth - 1) {
      for (std::size_t a = 0; a < sizeof(to) / sizeof(to[0]); ++a) store(to[a] + k, load<Doubles>(from[a] + index[0]));
    } else {
      for (std::size_t a = 0; a < sizeof(to) / sizeof(to[0]); ++a) {
        for (std::size_t i = 0; i < kWidth; ++i) to[a][k + i] = from[a][index[i]];
      }
    }
    for (std::size_t i = 0; i < kWidth; ++i)
      at.compaction[k + i] = static_cast<double>(open.state[kCompaction][index[i]]);
    store(&at.last_step[k], abs(load<Doubles>(&at.inside[k]) - load<Doubles>(&at.outside[k])));
  }

  std::uint32_t groups[kCapTile / kWidth];
  std::size_t group_count = 0;
  for (std::size_t k = 0; k < filled; k += kWidth) groups[group_count++] = static_cast<std::uint32_t>(k);
  for (int i = 0;; ++i) {
    std::size_t remaining = 0;
    for (std::size_t g = 0; g < group_count; ++g) {
      const std::uint32_t k = groups[g];
      groups[remaining] = k;
      remaining += iterateOnce(p, at, k, i <= kMaxNewtonSteps) ? 1 : 0;
    }
    group_count = remaining;
    if (group_count == 0 || i == kMaxIterations) break;
    for (std::size_t g = 0; g < group_count; ++g) moveCaps(p, at, groups[g]);
  }

  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t end = open.iterating[k];
    open.j1[end] = at.j1[k];
    open.s[end] = at.trial_s[k] < at.s[k] ? at.trial_s[k] : at.s[k];
    open.increment[end] = at.increment[k];
    open.left[end] = ~at.done[k];
  }
}

/// Damage grows, but not by what float cannot resolve, or rest would creep.
BRASH_ICE_INLINE void raise(float* damage, Mask grows, Doubles value) {
  const Doubles old = widen(damage);
  store(damage, narrow(select(grows & (value > old + kDamageResolution), value, old)));
}

/// CapModel::degradeStress.
/// @param shears  whether this step flowed on the shear surface, i.e. without compaction
/// @return the share of the stress that damage leaves
BRASH_ICE_INLINE Doubles degradeStress(const CapConstants& p, Open& open, std::size_t k, const Doubles* undamaged,
                                       Doubles j1, Doubles s, Mask shears) {
  // The part of the elastic strain that is there only because the modulus is scaled.
  const double excess = 1.0 - p.stiffness_scale;
  const double excess_shear = 0.5 * excess / p.shear_modulus_pa;
  const Doubles excess_volume = j1 * (excess_shear / 3.0 - excess / (9.0 * p.bulk_modulus_pa));
  Doubles e[6];
  for (std::size_t c = 0; c < 6; ++c) {
    float* const total = &open.state[kTotalStrain + c][k];
    const Floats sum = narrow(widen(total) + widen(&open.strain[c][k]));
    store(total, sum);
    e[c] = widen(sum) - excess_shear * undamaged[c];
    if (c < 3) e[c] -= excess_volume;
  }

  // A crack that is still open carries no shear either.
  Mask tensile = j1 < 0.0;
  if (p.gap_memory) tensile |= widen(&open.state[kGap][k]) > 0.0;
  const Doubles product = undamaged[0] * e[0] + undamaged[1] * e[1] + undamaged[2] * e[2] +
                          2.0 * (undamaged[3] * e[3] + undamaged[4] * e[4] + undamaged[5] * e[5]);
  Doubles measure = squareRoot(larger(0.5 * product, Doubles{}));
  const bool any_tensile = any(tensile);
  if (any_tensile) measure = select(tensile, p.root_elastic * computeLargestPrincipal(e), measure);

  Doubles brittle_threshold = widen(&open.state[kBrittleThreshold][k]);
  Doubles ductile_threshold = widen(&open.state[kDuctileThreshold][k]);
  Doubles threshold = select(tensile, brittle_threshold, ductile_threshold);
  const Doubles met = select(measure != 0.0, measure, splat(1e-30));
  threshold = select(shears & (threshold == 0.0), asFloat(met), threshold);
  store(&open.state[kBrittleThreshold][k], narrow(select(tensile, threshold, brittle_threshold)));
  store(&open.state[kDuctileThreshold][k], narrow(select(tensile, ductile_threshold, threshold)));
  Mask left = load<Mask>(&open.left[k]);
  left |= ~isFinite(measure);
  store(&open.left[k], left);

  const Doubles growth = measure - threshold;
  const Mask grows = (threshold != 0.0) & (growth > 0.0);
  if (any(grows)) {
    // Softening::fractureEnergy.
    const Doubles deviatoric = kRootOfThree * s;
    const Doubles size = abs(j1);
    const Doubles ratio = select(size >= deviatoric, splat(1.0), size / deviatoric);
    const Doubles square = ratio * ratio;
    const double shear = p.fracture_energy_shear_jpm2;
    const Doubles energy = shear + select(j1 <= 0.0, ratio * (p.fracture_energy_tension_jpm2 - shear),
                                          square * square * ratio * (p.fracture_energy_compression_jpm2 - shear));
    // Softening::ductileRate and maxDuctileDamage.
    const Doubles linear = threshold * p.ductile_log;
    const Doubles energy_per_length = energy * (1.0 / p.element_length_m);
    Doubles rate = 2.0 * (linear + squareRoot(linear * linear + p.ductile_dilog * energy_per_length));
    const Doubles confined = select(deviatoric >= j1, splat(1.0), deviatoric / j1);
    Doubles limit = smaller(splat(kMaxDamage), confined * squareRoot(confined));
    Doubles shape = splat(p.ductile_shape);
    if (any_tensile) {
      // Softening::brittleRate.
      const Doubles strongest = computeLargestPrincipal(undamaged) * (1.0 / p.root_elastic);
      rate = select(tensile, strongest * p.brittle_log, rate);
      limit = select(tensile, splat(kMaxDamage), limit);
      shape = select(tensile, splat(p.brittle_shape), shape);
    }
    const Doubles decay = computeExp(-growth * rate / energy_per_length);
    const Doubles value = limit * (1.0 - decay) / (1.0 + shape * decay);
    raise(&open.state[kBrittleDamage][k], grows & tensile, value);
    raise(&open.state[kDuctileDamage][k], grows & ~tensile, value);
  }
  const Doubles brittle = widen(&open.state[kBrittleDamage][k]), ductile = widen(&open.state[kDuctileDamage][k]);
  const Doubles applied = select(tensile, larger(brittle, ductile), ductile);
  store(&open.state[kDamage][k], narrow(applied));
  return 1.0 - applied;
}

/// The rest of CapModel::updateParticle, after the return.
/// @return whether any particle is left
bool finish(const CapConstants& p, Open& open, std::size_t count) {
  const double inverse_shear = 1.0 / (kRootOfThree * p.shear_modulus_pa);
  Mask any_left = {};
  for (std::size_t k = 0; k < count; k += kWidth) {
    const Doubles trial_j1 = load<Doubles>(&open.trial_j1[k]), trial_s = load<Doubles>(&open.trial_s[k]);
    const Doubles j1 = load<Doubles>(&open.j1[k]), s = load<Doubles>(&open.s[k]);
    const Doubles increment = load<Doubles>(&open.increment[k]);
    const Mask yields = load<Mask>(&open.yields[k]);
    const Doubles shrink = select(trial_s > 0.0, s / trial_s, Doubles{});
    Doubles stress[6];
    for (std::size_t c = 0; c < 6; ++c) {
      const Doubles trial = load<Doubles>(&open.trial[c][k]);
      const Doubles deviator = c < 3 ? trial + trial_j1 * (1.0 / 3.0) : trial;
      stress[c] = select(yields, c < 3 ? shrink * deviator - j1 * (1.0 / 3.0) : shrink * deviator, trial);
    }
    const Doubles compaction = widen(&open.state[kCompaction][k]);
    store(&open.state[kCompaction][k], narrow(select(yields, larger(compaction + increment, Doubles{}), compaction)));
    const Doubles plastic_strain = widen(&open.state[kPlasticStrain][k]);
    store(&open.state[kPlasticStrain][k], narrow(plastic_strain + (trial_s - s) * inverse_shear));
    if (p.gap_memory) {
      const Doubles gap = widen(&open.state[kGap][k]);
      store(&open.state[kGap][k], narrow(select((increment < 0.0) & (j1 <= 0.0), gap - increment, gap)));
    }
    if (p.damages) {
      const Doubles share = degradeStress(p, open, k, stress, j1, s, yields & (increment <= 0.0));
      for (std::size_t c = 0; c < 6; ++c) stress[c] *= share;
    }
    for (std::size_t c = 0; c < 6; ++c) store(&open.stress[c][k], narrow(stress[c]));
    any_left |= load<Mask>(&open.left[k]);
  }
  return any(any_left);
}

std::size_t update(const CapConstants& constants, const CapBatch& batch, std::size_t begin, std::size_t count,
                   std::uint32_t* left) {
  if (constants.leaves_yielding) return updateElastic(constants, batch, begin, count, left);
  std::uint32_t index[kCapTile];
  const std::size_t n = updateElastic(constants, batch, begin, count, index);
  if (n == 0) return 0;
  const std::size_t filled = roundUp(n);
  for (std::size_t k = n; k < filled; ++k) index[k] = index[n - 1];

  Open open;
  // Arrays of the batch and where their open values go; the first six are read only.
  const float* from[12 + kCapStates];
  float* to[12 + kCapStates];
  std::size_t arrays = 0;
  for (std::size_t c = 0; c < 6; ++c) {
    from[arrays] = batch.strain_increment[c] + begin;
    to[arrays++] = open.strain[c];
  }
  for (std::size_t c = 0; c < 6; ++c) {
    from[arrays] = batch.stress[c] + begin;
    to[arrays++] = open.stress[c];
  }
  for (std::size_t i = 0; i < kCapStates; ++i) {
    if (batch.state[i] == nullptr) continue;
    from[arrays] = batch.state[i] + begin;
    to[arrays++] = open.state[i];
  }
  for (std::size_t k = 0; k < filled; k += kWidth) {
    const std::uint32_t* const at = &index[k];
    if (at[kWidth - 1] - at[0] == kWidth - 1) {
      for (std::size_t a = 0; a < arrays; ++a) store(to[a] + k, load<Floats>(from[a] + at[0]));
    } else {
      for (std::size_t a = 0; a < arrays; ++a) {
        for (std::size_t i = 0; i < kWidth; ++i) to[a][k + i] = from[a][at[i]];
      }
    }
  }
  const std::size_t iterating = predict(constants, open, filled);
  if (iterating > 0) iterate(constants, open, iterating);
  const bool any_left = finish(constants, open, filled);
  std::size_t left_count = 0;
  if (any_left) {
    for (std::size_t k = 0; k < n; ++k) {
      if (open.left[k] == 0) continue;
      // Its old values go back.
      for (std::size_t a = 6; a < arrays; ++a) to[a][k] = from[a][index[k]];
      left[left_count++] = index[k];
    }
    for (std::size_t k = n; k < filled; ++k) {
      for (std::size_t a = 6; a < arrays; ++a) to[a][k] = to[a][n - 1];
    }
  }
  float* back[12 + kCapStates];
  for (std::size_t c = 0; c < 6; ++c) back[6 + c] = batch.stress[c] + begin;
  std::size_t a = 12;
  for (std::size_t i = 0; i < kCapStates; ++i) {
    if (batch.state[i] != nullptr) back[a++] = batch.state[i] + begin;
  }
  for (std::size_t k = 0; k < filled; k += kWidth) {
    const std::uint32_t* const at = &index[k];
    if (at[kWidth - 1] - at[0] == kWidth - 1) {
      for (a = 6; a < arrays; ++a) store(back[a] + at[0], load<Floats>(to[a] + k));
    } else {
      for (a = 6; a < arrays; ++a) {
        for (std::size_t i = 0; i < kWidth; ++i) back[a][at[i]] = to[a][k + i];
      }
    }
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

#define BRASH_ICE_JOIN(a, b) a##b
#define BRASH_ICE_NAME(a, b) BRASH_ICE_JOIN(a, b)
extern const CapKernels BRASH_ICE_NAME(kCapKernels_, BRASH_ICE_INSTRUCTION_SET);
const CapKernels BRASH_ICE_NAME(kCapKernels_, BRASH_ICE_INSTRUCTION_SET) = {update, computeLogs, computeExps,
                                                                            computeLargestPrincipals};

}  // namespace brash_ice_rig
