#include "brash_ice_rig/config/config_error.h"

#include <utility>

namespace brash_ice_rig {
namespace {

/// Of what a file or a caller has sent no more than a reader, a log or a ROS message can bear; what() alone is cut.
std::string shortened(const std::string& text, std::size_t most) {
  if (text.size() <= most) return text;
  const auto insideOfCharacter = [&](std::size_t at) {
    return (static_cast<unsigned char>(text[at]) & 0xc0u) == 0x80u;
  };
  std::size_t end = most;
  while (end > 0 && insideOfCharacter(end)) --end;
  return text.substr(0, end) + "... (" + std::to_string(text.size()) + " characters)";
}

std::string describe(const std::string& key, const std::string& value, const std::string& rule,
                     const std::string& where) {
  constexpr std::size_t kName = 300, kRule = 4000;
  const std::string text = where.empty() ? "" : shortened(where, kRule) + ": ";
  const std::string short_key = shortened(key, kName), short_rule = shortened(rule, kRule);
  if (!value.empty()) return text + short_key + " = " + shortened(value, kName) + ", " + short_rule;
  const bool rule_names_key = rule.find(key) != std::string::npos;
  return text + (rule_names_key ? "" : short_key + ": ") + short_rule;
}

}  // namespace

ConfigError::ConfigError(std::string key, std::string value, std::string rule, std::string where)
    : std::runtime_error(describe(key, value, rule, where)),
      key_(std::move(key)),
      value_(std::move(value)),
      rule_(std::move(rule)),
      where_(std::move(where)) {}

}  // namespace brash_ice_rig
