#pragma once

#include <cstdint>
#include <cstdio>
#include <initializer_list>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "brash_ice_rig/config/scenario.h"

namespace brash_ice_rig {

/// Walks visit(): the numeric keys with their ranges, and each value as exact text.
class KeyLister {
 public:
  struct Number {
    std::string key;
    Range range;
    bool whole;
  };

  explicit KeyLister(Scenario scenario) { scenario.visit(*this); }

  std::vector<Number> numbers;
  std::map<std::string, std::string> words;  ///< key to its words, joined by commas
  std::vector<std::string> switches;
  std::map<std::string, std::string> values;

  void operator()(const char* name, double& value, const Range& range, const char*) { add(name, value, range, false); }
  void operator()(const char* name, int& value, const Range& range, const char*) { add(name, value, range, true); }
  void operator()(const char* name, std::uint64_t& value, const Range& range, const char*) {
    add(name, value, range, true);
  }
  void operator()(const char* name, std::optional<double>& value, const Range& range, const char*) {
    add(name, value.value_or(-1.0), range, false);
  }
  void operator()(const char* name, bool& value, const char*) {
    switches.push_back(section_ + name);
    values[section_ + name] = value ? "true" : "false";
  }
  void operator()(const char* name, std::string& value, const char*) { values[section_ + name] = value; }
  template <class Enum>
  void operator()(const char* name, Enum& value, std::initializer_list<const char*> allowed, const char*) {
    std::string& joined = words[section_ + name];
    for (const char* word : allowed) joined += (joined.empty() ? "" : ", ") + std::string(word);
    values[section_ + name] = std::to_string(static_cast<int>(value));
  }
  template <class Section>
  void section(const char* name, Section& section) {
    const std::string outer = section_;
    section_ += std::string(name) + ".";
    section.visit(*this);
    section_ = outer;
  }

 private:
  template <class T>
  void add(const char* name, T value, const Range& range, bool whole) {
    numbers.push_back({section_ + name, range, whole});
    char text[40];
    std::snprintf(text, sizeof(text), "%a", static_cast<double>(value));
    values[section_ + name] = text;
  }

  std::string section_;
};

}  // namespace brash_ice_rig
