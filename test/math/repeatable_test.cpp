// The functions against those of the C library in extended precision, whose 64 bits leave its own error out of account.

#include "brash_ice_rig/math/repeatable.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <regex>
#include <string>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double ulpOf(double x) {
  const double size = std::abs(x);
  return std::max(std::nextafter(size, kInfinity) - size, std::numeric_limits<double>::denorm_min());
}

/// Largest error over an interval, in units in the last place.
template <class Ours, class Theirs>
double largestError(Ours ours, Theirs theirs, double low, double high) {
  std::mt19937_64 generator(1);
  std::uniform_real_distribution<double> between(low, high);
  double largest = 0.0;
  for (int i = 0; i < 100000; ++i) {
    const double x = between(generator);
    const long double expected = theirs(static_cast<long double>(x));
    const double error = static_cast<double>(std::abs(static_cast<long double>(ours(x)) - expected)) /
                         ulpOf(static_cast<double>(expected));
    largest = std::max(largest, std::isnan(error) ? kInfinity : error);
  }
  return largest;
}

#define EXPECT_ERROR(name, low, high, ulp)                                                \
  EXPECT_LE(largestError(                                                                 \
                repeatable::name, [](long double x) { return std::name(x); }, low, high), \
            ulp)

TEST(Repeatable, ErrorsAreAsDocumented) {
  if (std::numeric_limits<long double>::digits < 64) GTEST_SKIP() << "no extended precision here";
  EXPECT_ERROR(exp, -1.0, 1.0, 1.0);
  EXPECT_ERROR(exp, -700.0, 700.0, 1.0);
  EXPECT_ERROR(expm1, -0.4, 0.4, 4.0);
  EXPECT_ERROR(expm1, -1e-9, 1e-9, 4.0);
  EXPECT_ERROR(expm1, -30.0, 30.0, 4.0);
  EXPECT_ERROR(log, 1e-9, 3.0, 1.0);
  EXPECT_ERROR(log, 0.9, 1.1, 1.0);
  EXPECT_ERROR(log, 1.0, 1e300, 1.0);
  EXPECT_ERROR(log1p, -0.999, 3.0, 2.0);
  EXPECT_ERROR(log1p, -1e-6, 1e-6, 2.0);
  EXPECT_ERROR(log1p, 0.0, 1e20, 2.0);
  EXPECT_ERROR(sin, -1.0, 1.0, 1.0);
  EXPECT_ERROR(sin, -30.0, 30.0, 1.0);
  EXPECT_ERROR(cos, -30.0, 30.0, 1.0);
  EXPECT_ERROR(cos, 0.0, 1e8, 1.0);
  EXPECT_ERROR(asin, -1.0, 1.0, 3.0);
  EXPECT_ERROR(asin, 0.999, 1.0, 3.0);
  EXPECT_ERROR(atan, -1.0, 1.0, 2.0);
  EXPECT_ERROR(atan, -30.0, 30.0, 2.0);
  EXPECT_ERROR(atan, 1.0, 1e12, 2.0);
  EXPECT_ERROR(cbrt, -3.0, 3.0, 1.0);
  EXPECT_ERROR(cbrt, 1e-300, 1e-290, 1.0);
  for (const double y : {-2.5, 0.1, 0.7, 3.0}) {
    const auto theirs = [y](long double x) { return std::pow(x, static_cast<long double>(y)); };
    EXPECT_LE(largestError([y](double x) { return repeatable::pow(x, y); }, theirs, 1e-3, 10.0),
              1.0 + 3.0 * std::abs(y) * 7.0);
  }
}

TEST(Repeatable, EndsOfTheRanges) {
  EXPECT_EQ(repeatable::exp(0.0), 1.0);
  EXPECT_EQ(repeatable::exp(-kInfinity), 0.0);
  EXPECT_EQ(repeatable::exp(kInfinity), kInfinity);
  EXPECT_EQ(repeatable::exp(709.9), kInfinity);
  EXPECT_NEAR(repeatable::exp(-740.0) / 4.2e-322, 1.0, 0.02);
  EXPECT_EQ(repeatable::expm1(-kInfinity), -1.0);
  EXPECT_EQ(repeatable::expm1(0.0), 0.0);
  EXPECT_EQ(repeatable::log(1.0), 0.0);
  EXPECT_EQ(repeatable::log(0.0), -kInfinity);
  EXPECT_EQ(repeatable::log(kInfinity), kInfinity);
  EXPECT_NEAR(repeatable::log(5e-324), -744.4400719213812, 1e-12);
  EXPECT_EQ(repeatable::log1p(-1.0), -kInfinity);
  EXPECT_EQ(repeatable::log1p(kInfinity), kInfinity);
  EXPECT_EQ(repeatable::asin(1.0), std::acos(0.0));
  EXPECT_EQ(repeatable::asin(-1.0), -std::acos(0.0));
  EXPECT_EQ(repeatable::atan(1.0), 0.5 * std::acos(0.0));
  EXPECT_EQ(repeatable::atan(kInfinity), std::acos(0.0));
  EXPECT_EQ(repeatable::atan(-kInfinity), -std::acos(0.0));
  EXPECT_EQ(repeatable::cos(0.0), 1.0);
  EXPECT_EQ(repeatable::pow(0.0, 0.3), 0.0);
  EXPECT_EQ(repeatable::pow(0.0, 0.0), 1.0);
  EXPECT_EQ(repeatable::cbrt(0.0), 0.0);
  EXPECT_EQ(repeatable::cbrt(-27.0), -3.0);
  for (const double x : {std::nan(""), -2.0}) EXPECT_TRUE(std::isnan(repeatable::log(x)));
  for (const double x : {std::nan(""), 1.5, -1.5}) EXPECT_TRUE(std::isnan(repeatable::asin(x)));
  for (const double x : {std::nan(""), kInfinity}) EXPECT_TRUE(std::isnan(repeatable::sin(x)));
  EXPECT_TRUE(std::isnan(repeatable::exp(std::nan(""))));
  EXPECT_TRUE(std::isnan(repeatable::pow(-1.0, 0.5)));
}

TEST(Repeatable, NormalNumbersHaveTheMomentsAndTheTailsOfTheDistribution) {
  std::mt19937_64 generator(5);
  constexpr int kCount = 400000;
  double mean = 0.0, square = 0.0, fourth = 0.0, product = 0.0, last = 0.0;
  int beyond_two = 0;
  for (int i = 0; i < kCount; ++i) {
    const double x = repeatable::normal(generator);
    mean += x / kCount;
    square += x * x / kCount;
    fourth += x * x * x * x / kCount;
    product += x * last / kCount;
    beyond_two += std::abs(x) > 2.0 ? 1 : 0;
    last = x;
  }
  // Within four standard errors: of the mean 1 / sqrt(n), the square sqrt(2 / n), the fourth power sqrt(96 / n).
  EXPECT_NEAR(mean, 0.0, 4.0 / std::sqrt(kCount));
  EXPECT_NEAR(square, 1.0, 4.0 * std::sqrt(2.0 / kCount));
  EXPECT_NEAR(fourth, 3.0, 4.0 * std::sqrt(96.0 / kCount));
  EXPECT_NEAR(product, 0.0, 4.0 / std::sqrt(kCount));
  EXPECT_NEAR(beyond_two / double{kCount}, 0.0455003, 4.0 * std::sqrt(0.0455 * 0.9545 / kCount));
}

// The C library's functions would come back unnoticed, since they differ on some machines only.
TEST(Repeatable, NothingThatMakesResultsCallsTheLibrarysOwn) {
  const std::regex call(
      R"(std::(exp2?|log(2|10|1p)?|expm1|pow|a?(sin|cos|tan)h?|atan2|cbrt|hypot|erfc?|[tl]gamma|normal_distribution)\b|\.computeDirect\()");
  int files = 0;
  for (const char* layer : {"effects", "ice", "material", "rig", "simulation", "sph", "water"}) {
    for (const char* side : {"/src/", "/include/brash_ice_rig/"}) {
      const std::string root = std::string(BRASH_ICE_SOURCE_DIR) + side + layer;
      if (!std::filesystem::exists(root)) continue;
      for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
        std::ifstream in(entry.path());
        const std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
        std::smatch found;
        EXPECT_FALSE(std::regex_search(text, found, call)) << entry.path() << ": " << found.str();
        ++files;
      }
    }
  }
  EXPECT_GT(files, 50);
}

}  // namespace
}  // namespace brash_ice_rig
