#pragma once

#include <random>

/// Elementary functions that give the same bits on every machine. Those of the C library do not: glibc takes other code
/// where the processor has fused multiply-add, and other versions of it round differently. These use nothing but
/// IEEE 754's + - * / and square root, whose results are prescribed, and must be compiled without contraction.
///
/// Largest errors, in units in the last place (ulp): exp, log, sin, cos, cbrt 1; log1p, atan 2; asin 3; expm1 4; pow
/// 1 + 3 |y ln x|. NaN gives NaN.
namespace brash_ice_rig::repeatable {

double exp(double x);

/// e^x - 1, accurate near 0, too.
double expm1(double x);

/// @return -infinity at 0, NaN below
double log(double x);

/// ln(1 + x), accurate near 0, too.
double log1p(double x);

/// @param x  |x| ≤ 1e8 rad; beyond, digits are lost
double sin(double x);
double cos(double x);

/// @param x  -1 to 1; NaN outside
double asin(double x);

double atan(double x);

/// x^y for x ≥ 0; NaN below. 0^y is 0, 1 or infinity, by the sign of y.
double pow(double x, double y);

/// @param x  finite
double cbrt(double x);

/// Draws from the normal distribution of mean 0 and standard deviation 1 (Marsaglia's polar method).
double normal(std::mt19937_64& generator);

}  // namespace brash_ice_rig::repeatable
