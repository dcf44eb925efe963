#include "brash_ice_rig/config/config_error.h"

#include <utility>

namespace brash_ice_rig {
namespace {

std::string describe(const std::string& key, const std::string& value, const std::string& rule,
                     const std::string& where) {
  std::string text = where.empty() ? "" : where + ": ";
  if (!value.empty()) return text + key + " = " + value + ", " + rule;
  const bool rule_names_key = rule.find(key) != std::string::npos;
  return text + (rule_names_key ? "" : key + ": ") + rule;
}

}  // namespace

ConfigError::ConfigError(std::string key, std::string value, std::string rule, std::string where)
    : std::runtime_error(describe(key, value, rule, where)),
      key_(std::move(key)),
      value_(std::move(value)),
      rule_(std::move(rule)),
      where_(std::move(where)) {}

}  // namespace brash_ice_rig
