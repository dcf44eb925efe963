#pragma once

#include <algorithm>
#include <string>
#include <vector>

namespace brash_ice_rig {

/// Cuts "a; b;c" into its entries; spaces around an entry and empty entries are dropped. A launch argument holds a list
/// in this form.
inline std::vector<std::string> splitList(const std::string& text) {
  std::vector<std::string> entries;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find(';', begin), text.size());
    const std::size_t first = text.find_first_not_of(" \t\r\n", begin);
    if (first < end) entries.push_back(text.substr(first, text.find_last_not_of(" \t\r\n", end - 1) - first + 1));
    begin = end + 1;
  }
  return entries;
}

}  // namespace brash_ice_rig
