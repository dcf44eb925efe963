#pragma once

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

namespace brash_ice_rig {

/// Fewest insertions, deletions and replacements of one letter that turn one word into the other.
inline int editDistance(const std::string& from, const std::string& to) {
  std::vector<int> row(to.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 0; i < from.size(); ++i) {
    int diagonal = row[0];
    row[0] = static_cast<int>(i) + 1;
    for (std::size_t j = 0; j < to.size(); ++j) {
      const int replaced = diagonal + (from[i] == to[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

/// So much of a misspelt word counts: nobody's word is longer, and what somebody else sends may be a million letters.
constexpr std::size_t kLongestWord = 100;

/// The word that a misspelt one is most likely meant to be; the first of several.
/// @param words  at least one
inline std::string nearestWord(const std::vector<std::string>& words, const std::string& unknown) {
  const std::string beginning = unknown.substr(0, kLongestWord);
  return *std::min_element(words.begin(), words.end(), [&](const std::string& left, const std::string& right) {
    return editDistance(beginning, left) < editDistance(beginning, right);
  });
}

}  // namespace brash_ice_rig
