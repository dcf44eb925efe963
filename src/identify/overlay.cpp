#include "brash_ice_rig/identify/overlay.h"

#include <algorithm>
#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "brash_ice_rig/config/scenario_reader.h"

namespace brash_ice_rig {
namespace {

bool belongs(const std::string& key) {
  for (const char* section : {"ice.", "water.", "collector.", "contact.", "effects."}) {
    if (key.compare(0, std::string(section).size(), section) == 0) return true;
  }
  return key == "field.thickness_m" || key == "procedure.start_gap_m";
}

}  // namespace

std::string toOverlay(const Scenario& scenario) {
  const auto values = keyValues(scenario), defaults = keyValues(Scenario());
  std::string text;
  std::vector<std::string> open;  // sections that the last line is in
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto& [key, value] = values[i];
    if (!belongs(key) || value == defaults[i].second || value.empty()) continue;
    std::vector<std::string> parts;
    for (std::size_t from = 0; from <= key.size();) {
      const std::size_t dot = std::min(key.find('.', from), key.size());
      parts.push_back(key.substr(from, dot - from));
      from = dot + 1;
    }
    std::size_t common = 0;
    while (common < open.size() && common + 1 < parts.size() && open[common] == parts[common]) ++common;
    for (std::size_t level = common; level + 1 < parts.size(); ++level) {
      text += std::string(2 * level, ' ') + parts[level] + ":\n";
    }
    // As YAML quotes it, where it needs quotes.
    YAML::Emitter scalar;
    scalar << value;
    text += std::string(2 * (parts.size() - 1), ' ') + parts.back() + ": " + scalar.c_str() + "\n";
    parts.pop_back();
    open = parts;
  }
  return text;
}

}  // namespace brash_ice_rig
