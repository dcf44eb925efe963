#pragma once

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
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

/// YAML's and C's spellings of what is no finite number.
inline bool isNonFiniteWord(const std::string& text) {
  std::string word = text.substr(std::min(text.find_first_not_of("+-."), text.size()));
  for (char& c : word) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return word == "nan" || word == "inf" || word == "infinity";
}

/// @param text  the value as the user wrote it
/// @throws ConfigError if the text is anything but a finite number
inline double numberFromText(const std::string& key, const std::string& text, const std::string& where = "") {
  const std::string shown = text.empty() ? "\"\"" : text;
  std::istringstream in(text);
  in.imbue(std::locale::classic());
  double value = 0.0;
  in >> std::noskipws >> value;
  const bool overflow = in.fail() && std::abs(value) == std::numeric_limits<double>::max();
  if (overflow || isNonFiniteWord(text)) throw ConfigError(key, shown, "must be a finite number", where);
  if (in.fail() || in.peek() != std::istringstream::traits_type::eof()) {
    throw ConfigError(key, shown, "must be a number", where);
  }
  return value;
}

/// @param text  a number as the user wrote it
/// @throws ConfigError if it is written with a point or an exponent
inline void checkWholeNumber(const std::string& key, const std::string& text, const std::string& where = "") {
  if (text.find_first_not_of("+-0123456789") == std::string::npos) return;
  throw ConfigError(key, text, "must be a whole number", where);
}

/// @param text  the value as the user wrote it
/// @throws ConfigError if the value is not finite or outside the range
inline void checkRange(const std::string& key, double value, const std::string& text, const Range& range,
                       const std::string& where = "") {
  if (!std::isfinite(value)) throw ConfigError(key, text, "must be a finite number", where);
  if (!range.contains(value)) throw ConfigError(key, text, "must lie in " + formatRange(range), where);
}

}  // namespace brash_ice_rig
