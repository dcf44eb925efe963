#pragma once

#include <stdexcept>
#include <string>

namespace brash_ice_rig {

/// The user's input is wrong. what() reads `file:line: key = value, rule` with the parts that are known; without a
/// value it reads `file:line: key: rule`, or `file:line: rule` where the rule itself names the key.
class ConfigError : public std::runtime_error {
 public:
  ConfigError(std::string key, std::string value, std::string rule, std::string where = "");

  const std::string& key() const { return key_; }
  const std::string& value() const { return value_; }
  const std::string& rule() const { return rule_; }
  /// `file:line`, or empty.
  const std::string& where() const { return where_; }

 private:
  std::string key_, value_, rule_, where_;
};

}  // namespace brash_ice_rig
