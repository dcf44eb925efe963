#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <yaml-cpp/node/node.h>

#include "brash_ice_rig/config/scenario.h"

namespace brash_ice_rig {

/// Largest YAML file that is read, bytes. A scenario with every key and its comments has 15 kB; what is larger than
/// this is another kind of file, given by mistake.
constexpr std::size_t kMaxYamlBytes = 4u << 20;

/// Reads a file that holds one YAML document with a map at its top.
/// @param content  what the map should hold, for the message: "must be a map of " + content
/// @throws ConfigError if the file cannot be read, is empty or too large, is not valid YAML, or holds anything else
YAML::Node readYamlMap(const std::string& path, const std::string& content);

/// The same of a text that is in memory already.
/// @param where  what to call its source in messages
YAML::Node parseYamlMap(const std::string& text, const std::string& where, const std::string& content);

/// A value of a YAML file with its place. What reads it throws ConfigError with file, line, key, value and rule.
struct YamlItem {
  std::string name;   ///< key within its map
  std::string key;    ///< the whole way to it, e.g. cases[0].name
  YAML::Node value;   ///< not defined: the file does not have it
  std::string file;   ///< path of the file
  std::string where;  ///< `file:line`

  bool exists() const { return value.IsDefined(); }

  [[noreturn]] void refuse(const std::string& rule) const;

  /// Text that is not empty.
  std::string text(const std::string& rule = "must be text") const;
  double number(const Range& range) const;
  std::uint64_t wholeNumber(const Range& range) const;
  /// One of some words.
  std::string word(const std::vector<std::string>& words) const;
  /// Elements, at least one.
  std::vector<YamlItem> list(const std::string& rule) const;
  /// Entries of a map, at least one, in the order of the file; none twice.
  std::vector<YamlItem> map(const std::string& rule) const;

 private:
  std::string whereIs(const YAML::Node& node) const;
};

/// A map that may have certain keys only.
class YamlSection {
 public:
  /// @throws ConfigError on an unknown key, naming the nearest of those that are allowed
  YamlSection(const YamlItem& map, const std::vector<std::string>& allowed);

  /// Its value is not defined where the map lacks it.
  YamlItem operator[](const std::string& name) const;

 private:
  YamlItem map_;
  std::vector<YamlItem> items_;
};

}  // namespace brash_ice_rig
