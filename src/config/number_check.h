#pragma once

#include <cmath>
#include <locale>
#include <sstream>
#include <string>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario.h"

namespace brash_ice_rig {

/// The fewest digits, from six on, that read back to the same double. Exponents come with a point and a sign (1.0e+06),
/// because YAML 1.1 readers such as Python's take 1e6 for text.
inline std::string formatNumber(double value) {
  std::string text;
  for (const int digits : {6, 15, 16, 17}) {
    std::ostringstream out;
    out.imbue(std::locale::classic());
    out.precision(digits);
    out << value;
    text = out.str();
    std::istringstream in(text);
    in.imbue(std::locale::classic());
    double read_back = 0.0;
    if (in >> read_back && read_back == value) break;
  }
  const auto exponent = text.find('e');
  if (exponent != std::string::npos && text.find('.') == std::string::npos) text.insert(exponent, ".0");
  return text;
}

/// Interval notation, e.g. `(0, 1]`.
inline std::string formatRange(const Range& range) {
  return (range.min_open ? "(" : "[") + formatNumber(range.min) + ", " + formatNumber(range.max) +
         (range.max_open ? ")" : "]");
}

/// @param text  the value as the user wrote it
/// @throws ConfigError if the value is not finite or outside the range
inline void checkRange(const std::string& key, double value, const std::string& text, const Range& range,
                       const std::string& where = "") {
  if (!std::isfinite(value)) throw ConfigError(key, text, "must be a finite number", where);
  if (!range.contains(value)) throw ConfigError(key, text, "must lie in " + formatRange(range), where);
}

}  // namespace brash_ice_rig
