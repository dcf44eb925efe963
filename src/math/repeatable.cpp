#include "brash_ice_rig/math/repeatable.h"

#include <cmath>
#include <cstdint>
#include <limits>

// Arguments are reduced to a short interval about 0, where a Taylor series does: its coefficients need no trust. frexp,
// ldexp, nearbyint and sqrt from the C library are exact or correctly rounded.

namespace brash_ice_rig::repeatable {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// ln 2 and pi / 2 in parts (their first bits, exact times any k that occurs, and the rest).
constexpr double kLn2High = 0x1.62e42fefa0000p-1, kLn2Low = 0x1.cf79abc9e3b3ap-40;
constexpr double kHalfPi1 = 0x1.921fb50000000p+0, kHalfPi2 = 0x1.110b460000000p-26, kHalfPi3 = 0x1.1a62633145c07p-54;
constexpr double kHalfPi = 0x1.921fb54442d18p+0, kHalfPiRest = 0x1.1a62633145c07p-54;

/// e^r - 1 for |r| ≤ 0.35, r^15 / 15! and on being left out.
double expm1NearZero(double r) {
  double sum = 0.0;
  for (int n = 14; n >= 2; --n) sum = (sum + 1.0) * (r / n);
  return r + r * sum;
}

/// ln((1 + s) / (1 - s)) = 2 artanh(s), less 2 s, for |s| ≤ 0.172.
double artanhRest(double s) {
  const double z = s * s;
  double sum = 0.0;
  for (int n = 23; n >= 3; n -= 2) sum = (sum + 1.0 / n) * z;
  return 2.0 * s * sum;
}

/// sin(r) and cos(r) for r = high + low, |r| ≤ pi / 4.
double sineNearZero(double high, double low) {
  const double z = high * high;
  double sum = 0.0;
  for (int n = 16; n >= 2; n -= 2) sum = (sum + 1.0) * (-z / (n * (n + 1)));
  return high + (high * sum + low * (1.0 - 0.5 * z));
}

double cosineNearZero(double high, double low) {
  const double z = high * high;
  double sum = 0.0;
  for (int n = 17; n >= 3; n -= 2) sum = (sum + 1.0) * (-z / (n * (n + 1)));
  // 1 - z / 2 + z / 2 * (...), the rounding of 1 - z / 2 made up for.
  const double half = 0.5 * z, one = 1.0 - half;
  return one + (((1.0 - one) - half) - (half * sum + high * low));
}

/// sin(x + quarter_turns pi / 2).
double sineOfTurned(double x, int quarter_turns) {
  if (!(std::abs(x) < kInfinity)) return kNan;
  const double k = std::nearbyint(x * (1.0 / kHalfPi));
  // Each difference is exact or nearly so; what the last one rounds away is kept.
  const double coarse = (x - k * kHalfPi1) - k * kHalfPi2;
  const double rest = k * kHalfPi3;
  const double high = coarse - rest;
  const double low = (coarse - high) - rest;
  const auto quadrant = (static_cast<std::int64_t>(std::fmod(k, 4.0)) + quarter_turns + 4) % 4;
  const double value = quadrant % 2 == 0 ? sineNearZero(high, low) : cosineNearZero(high, low);
  return quadrant < 2 ? value : -value;
}

}  // namespace

double exp(double x) {
  if (x > 710.0) return kInfinity;
  if (x < -746.0) return 0.0;
  if (std::isnan(x)) return x;
  const double k = std::nearbyint(x * 0x1.71547652b82fep+0);
  const double high = x - k * kLn2High, low = k * kLn2Low;
  const double r = high - low;
  const double error = (high - r) - low;
  const double rest = expm1NearZero(r);
  return std::ldexp(1.0 + (rest + error), static_cast<int>(k));
}

double expm1(double x) {
  return std::abs(x) < 0.35 ? expm1NearZero(x) : exp(x) - 1.0;
}

double log(double x) {
  if (std::isnan(x) || x == kInfinity) return x;
  if (x < 0.0) return kNan;
  if (x == 0.0) return -kInfinity;
  int exponent = 0;
  double m = std::frexp(x, &exponent);
  if (m < 0.70710678118654752) {
    m *= 2.0;
    --exponent;
  }
  // 2 s = f - s f with f = m - 1, which is exact.
  const double f = m - 1.0, s = f / (m + 1.0);
  const double k = exponent;
  return k * kLn2High + (f - (s * f - (artanhRest(s) + k * kLn2Low)));
}

double log1p(double x) {
  if (!(x > -1.0) || x == kInfinity) return log(1.0 + x);
  if (x > -0.29 && x < 0.41) {
    const double s = x / (2.0 + x);
    return x - (s * x - artanhRest(s));
  }
  const double sum = 1.0 + x;
  // What the sum has rounded away.
  const double rest = x > 1.0 ? 1.0 - (sum - x) : x - (sum - 1.0);
  return log(sum) + rest / sum;
}

double sin(double x) {
  return sineOfTurned(x, 0);
}

double cos(double x) {
  return sineOfTurned(x, 1);
}

double asin(double x) {
  const double size = std::abs(x);
  if (!(size <= 1.0)) return kNan;
  // sin(pi / 2 - 2 a) = 1 - 2 sin²(a).
  const bool steep = size > 0.5;
  const double z = steep ? 0.5 * (1.0 - size) : size * size;
  // x + x³ / 6 + ...: each coefficient is the one before times (2n - 1)² / (2n (2n + 1)).
  double sum = 0.0;
  for (int n = 26; n >= 1; --n)
    sum = (sum + 1.0) * (z * ((2.0 * n - 1.0) * (2.0 * n - 1.0) / (2.0 * n * (2.0 * n + 1.0))));
  const double root = steep ? std::sqrt(z) : size;
  const double small = root + root * sum;
  const double angle = steep ? kHalfPi - (2.0 * small - kHalfPiRest) : small;
  return x < 0.0 ? -angle : angle;
}

double atan(double x) {
  constexpr double kTanOfSixteenthTurn = 0.41421356237309505;  // of 22.5 degrees
  const double size = std::abs(x);
  // atan x = b + atan s with the nearest of b = 0, pi / 4 and pi / 2.
  const int octants = size > 1.0 / kTanOfSixteenthTurn ? 2 : size > kTanOfSixteenthTurn ? 1 : 0;
  const double s = octants == 2 ? -1.0 / size : octants == 1 ? (size - 1.0) / (size + 1.0) : size;
  const double z = s * s;
  double sum = 0.0;
  for (int n = 45; n >= 3; n -= 2) sum = (sum + 1.0 / n) * -z;
  const double angle = octants * (0.5 * kHalfPi) + (s + (s * sum + octants * (0.5 * kHalfPiRest)));
  return x < 0.0 ? -angle : angle;
}

double pow(double x, double y) {
  if (y == 0.0 || x == 1.0) return 1.0;
  return exp(y * log(x));
}

double cbrt(double x) {
  if (x == 0.0) return x;
  int exponent = 0;
  double m = std::frexp(x, &exponent);  // 0.5 ≤ |m| < 1
  for (; exponent % 3 != 0; ++exponent) m *= 0.5;
  // From a line through the ends of [1/8, 1], by Newton's steps, each of which squares the error (at first 8 %).
  const double size = std::abs(m);
  double root = 0.45 + 0.57 * size;
  for (int i = 0; i < 5; ++i) root -= (root - size / (root * root)) / 3.0;
  return std::ldexp(x < 0.0 ? -root : root, exponent / 3);
}

double normal(std::mt19937_64& generator) {
  const auto symmetric = [&generator] { return static_cast<double>(generator() >> 11) * 0x1p-52 - 1.0; };
  while (true) {
    const double x = symmetric(), y = symmetric();
    const double square = x * x + y * y;
    // The second number of the pair is left: keeping it would be one more state.
    if (square > 0.0 && square < 1.0) return x * std::sqrt(-2.0 * log(square) / square);
  }
}

}  // namespace brash_ice_rig::repeatable
