#include "brash_ice_rig/config/scenario_reader.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <functional>
#include <initializer_list>
#include <limits>
#include <map>
#include <optional>
#include <sstream>
#include <type_traits>
#include <utility>
#include <vector>

#include "brash_ice_rig/config/edit_distance.h"
#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/config/yaml_document.h"
#include "brash_ice_rig/version.h"

namespace brash_ice_rig {
namespace {

/// One key with its value as the user wrote it.
struct Entry {
  enum class Kind { kScalar, kNull, kList, kMap };

  std::string key;  ///< with its section
  Kind kind = Kind::kScalar;
  std::string text;
  std::string where;  ///< `file:line` or --set

  [[noreturn]] void refuse(const std::string& rule) const { throw ConfigError(key, shownValue(), rule, where); }

  /// Rules of all keys ask for a single value.
  void requireScalar(const std::string& rule) const {
    if (kind == Kind::kNull) throw ConfigError(key, "", key + " has no value, " + rule, where);
    if (kind != Kind::kScalar) refuse(rule);
  }

  std::string shownValue() const {
    switch (kind) {
      case Kind::kList:
        return "[...]";
      case Kind::kMap:
        return "{...}";
      case Kind::kNull:
        return "";
      case Kind::kScalar:
        break;
    }
    return text.empty() ? "\"\"" : text;
  }
};

// ---- from text to values

double parseNumber(const Entry& entry) {
  entry.requireScalar("must be a number");
  return numberFromText(entry.key, entry.text, entry.where);
}

template <class Number>
Number parseNumber(const Entry& entry, const Range& range) {
  const double value = parseNumber(entry);
  if constexpr (std::is_integral_v<Number>) {
    checkWholeNumber(entry.key, entry.text, entry.where);
    checkRange(entry.key, value, entry.text, range, entry.where);
    return static_cast<Number>(std::stoll(entry.text));
  } else {
    checkRange(entry.key, value, entry.text, range, entry.where);
    return value;
  }
}

template <class Number>
std::string formatValue(Number value) {
  if constexpr (std::is_integral_v<Number>) {
    return std::to_string(value);
  } else {
    return formatNumber(value);
  }
}

std::string doubleQuoted(const std::string& text) {
  YAML::Emitter out;
  out << YAML::DoubleQuoted << text;
  return out.c_str();
}

std::string joinWords(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i > 0) text += i + 1 < words.size() ? ", " : " or ";
    text += words[i];
  }
  return text;
}

// ---- the keys of a scenario

/// A key tied to the member that it sets.
struct Key {
  std::string section;  ///< empty at the top level; "outer.inner" for a section in a section
  std::string name;
  std::string help;
  std::function<void(const Entry&)> read;
  std::function<std::string()> write;  ///< as YAML; empty: not set

  std::string fullName() const { return section.empty() ? name : section + "." + name; }
};

/// Collects the keys of a scenario, in the order of visit().
class KeyTable {
 public:
  explicit KeyTable(Scenario& scenario) { scenario.visit(*this); }

  const std::vector<Key>& keys() const { return keys_; }

  const Key* find(const std::string& full_name) const {
    const auto found =
        std::find_if(keys_.begin(), keys_.end(), [&](const Key& key) { return key.fullName() == full_name; });
    return found == keys_.end() ? nullptr : &*found;
  }

  bool isSection(const std::string& name) const {
    return std::find(sections_.begin(), sections_.end(), name) != sections_.end();
  }

  const std::vector<std::string>& sections() const { return sections_; }

  // What visit() calls.
  template <class Number>
  void operator()(const char* name, Number& member, const Range& range, const char* text) {
    add(
        name, std::string(text) + "; " + formatRange(range),
        [&member, range](const Entry& entry) { member = parseNumber<Number>(entry, range); },
        [&member] { return formatValue(member); });
  }
  void operator()(const char* name, std::optional<double>& member, const Range& range, const char* text) {
    add(
        name, std::string(text) + "; " + formatRange(range),
        [&member, range](const Entry& entry) { member = parseNumber<double>(entry, range); },
        [&member] { return member ? formatNumber(*member) : std::string(); });
  }
  void operator()(const char* name, bool& member, const char* text) {
    add(
        name, text,
        [&member](const Entry& entry) {
          const std::string rule = "must be true or false";
          entry.requireScalar(rule);
          if (entry.text != "true" && entry.text != "false") entry.refuse(rule);
          member = entry.text == "true";
        },
        [&member] { return std::string(member ? "true" : "false"); });
  }
  void operator()(const char* name, std::string& member, const char* text) {
    add(
        name, text,
        [&member](const Entry& entry) {
          entry.requireScalar("must be text");
          member = entry.text;
        },
        [&member] { return doubleQuoted(member); });
  }
  template <class Enum>
  void operator()(const char* name, Enum& member, std::initializer_list<const char*> word_list, const char* text) {
    const std::vector<std::string> words(word_list.begin(), word_list.end());
    add(
        name, std::string(text) + "; " + joinWords(words),
        [&member, words](const Entry& entry) {
          const std::string rule = "must be " + joinWords(words);
          entry.requireScalar(rule);
          const auto found = std::find(words.begin(), words.end(), entry.text);
          if (found == words.end()) entry.refuse(rule);
          member = static_cast<Enum>(found - words.begin());
        },
        [&member, words] { return words.at(static_cast<std::size_t>(member)); });
  }
  template <class Section>
  void section(const char* name, Section& section) {
    const std::string outer = section_;
    section_ = outer.empty() ? name : outer + "." + name;
    sections_.push_back(section_);
    section.visit(*this);
    section_ = outer;
  }

 private:
  void add(std::string name, std::string help, std::function<void(const Entry&)> read,
           std::function<std::string()> write) {
    keys_.push_back({section_, std::move(name), std::move(help), std::move(read), std::move(write)});
  }

  std::string section_;  ///< the one being visited, with those around it
  std::vector<std::string> sections_;
  std::vector<Key> keys_;
};

// ---- unknown keys

/// Nearest known key or section. The right name in a wrong section, or without one, counts as two wrong letters;
/// letters that are wrong in it count twice, because short names all resemble each other. Of several, the one whose
/// whole name is nearest: the sections of effects have keys of the same name.
std::string nearestName(const KeyTable& table, const std::string& unknown) {
  const std::string unknown_leaf = unknown.substr(unknown.rfind('.') + 1);
  std::string nearest;
  std::pair<int, int> least(std::numeric_limits<int>::max(), 0);
  // Names whose length alone tells that they are farther are not looked at.
  const auto atLeast = [](const std::string& left, const std::string& right) {
    const std::size_t longer = std::max(left.size(), right.size()), shorter = std::min(left.size(), right.size());
    return static_cast<int>(longer - shorter);
  };
  const auto consider = [&](const std::string& candidate, int distance, int whole_distance) {
    if (std::make_pair(distance, whole_distance) >= least) return;
    least = {distance, whole_distance};
    nearest = candidate;
  };
  for (const std::string& section : table.sections()) {
    const int distance = editDistance(unknown, section);
    consider(section, distance, distance);
  }
  for (const Key& key : table.keys()) {
    const std::string name = key.fullName();
    if (std::min(atLeast(unknown, name), 2 + 2 * atLeast(unknown_leaf, key.name)) > least.first) continue;
    const int elsewhere = 2 + 2 * editDistance(unknown_leaf, key.name);
    const int distance = editDistance(unknown, name);
    consider(name, std::min(distance, elsewhere), distance);
  }
  return nearest;
}

// ---- sources

/// Sections within sections that are looked into. YAML aliases can nest without end.
constexpr int kMaxDepth = 4;

/// Appends the keys of a map and of the maps in it, in the order of the file.
void flatten(const YAML::Node& map, const std::string& prefix, const std::string& file, std::vector<Entry>& entries,
             int depth = 1) {
  std::map<std::string, int> line_of;
  for (const auto& pair : map) {
    const int line = pair.first.Mark().line + 1;
    const std::string where = file + ":" + std::to_string(line);
    if (!pair.first.IsScalar()) throw ConfigError("", "", "each key must be a single word", where);
    Entry entry;
    entry.key = prefix + pair.first.Scalar();
    entry.where = where;
    const auto [first, is_new] = line_of.emplace(entry.key, line);
    if (!is_new) {
      throw ConfigError(entry.key, "", entry.key + " is given twice, first in line " + std::to_string(first->second),
                        where);
    }
    const YAML::Node& value = pair.second;
    if (value.IsMap() && value.size() > 0 && depth < kMaxDepth) {
      flatten(value, entry.key + ".", file, entries, depth + 1);
      continue;
    }
    if (value.IsScalar()) entry.text = value.Scalar();
    if (value.IsNull()) entry.kind = Entry::Kind::kNull;
    if (value.IsSequence()) entry.kind = Entry::Kind::kList;
    if (value.IsMap()) entry.kind = Entry::Kind::kMap;
    entries.push_back(std::move(entry));
  }
}

constexpr const char* kContent = "sections, such as `field:` with indented `spacing_m: 0.3`";

std::vector<Entry> readFile(const std::string& path) {
  std::vector<Entry> entries;
  flatten(readYamlMap(path, kContent), "", path, entries);
  return entries;
}

constexpr const char* kSettingSource = "--set";

Entry parseSetting(const std::string& setting) {
  const auto equals = setting.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw ConfigError("", "", "`" + setting + "` must read section.key=value", kSettingSource);
  }
  Entry entry;
  entry.key = setting.substr(0, equals);
  entry.text = setting.substr(equals + 1);
  entry.where = kSettingSource;
  return entry;
}

/// Builds a scenario from entries, the later ones winning, and remembers where each value came from.
class Composer {
 public:
  Composer() = default;
  Composer(const Composer&) = delete;  // the key table points into this object's scenario
  Composer& operator=(const Composer&) = delete;

  void applyFile(const std::string& path) {
    for (const Entry& entry : readFile(path)) apply(entry);
  }

  void applyText(const std::string& yaml, const std::string& where) {
    std::vector<Entry> entries;
    flatten(parseYamlMap(yaml, where, kContent), "", where, entries);
    for (const Entry& entry : entries) apply(entry);
  }

  void applyOverlay(const std::string& path) {
    ++layer_;
    for (const Entry& entry : readFile(path)) {
      const Key* key = apply(entry);
      if (key == nullptr) continue;
      const std::string value = key->write();
      const auto [earlier, is_new] = overlay_values_.emplace(entry.key, std::make_pair(value, entry.where));
      if (!is_new && earlier->second.first != value) {
        entry.refuse("contradicts the overlay " + earlier->second.second + ", which gives " + earlier->second.first);
      }
    }
  }

  void applySettings(const std::vector<std::string>& settings) {
    ++layer_;
    for (const std::string& setting : settings) apply(parseSetting(setting));
  }

  const Scenario& unchecked() const { return scenario_; }

  /// @param file  the scenario file, named where a rule is broken by defaults
  Scenario finish(const std::string& file) const {
    checkStrengthIsUsed();
    try {
      scenario_.validate();
    } catch (const ConfigError& error) {
      const auto origin = origins_.find(error.key());
      throw ConfigError(error.key(), error.value(), error.rule(),
                        origin == origins_.end() ? file : origin->second.where);
    }
    return scenario_;
  }

 private:
  struct Origin {
    int layer;  ///< 0 file, 1 first overlay ...
    std::string where;
  };

  /// @return the key, or null for an empty section
  const Key* apply(const Entry& entry) {
    const Key* key = table_.find(entry.key);
    if (key == nullptr) {
      const bool is_section = table_.isSection(entry.key);
      if (is_section && (entry.kind == Entry::Kind::kNull || entry.kind == Entry::Kind::kMap)) return nullptr;
      if (is_section) entry.refuse("must be a section with keys of its own");
      throw ConfigError(
          entry.key, "",
          "unknown key " + entry.key + "; did you mean " + nearestName(table_, entry.key.substr(0, kLongestWord)) + "?",
          entry.where);
    }
    key->read(entry);
    origins_[entry.key] = {layer_, entry.where};
    return key;
  }

  /// alpha and theta replace what eq. 10 makes of cohesion and friction angle. Overriding the latter on top of a file
  /// that gives the former would silently do nothing.
  void checkStrengthIsUsed() const {
    const std::pair<const char*, const char*> replaced_by[] = {
        {"ice.cohesion_pa", "ice.shear_constant_pa"},
        {"ice.friction_angle_deg", "ice.shear_constant_pa"},
        {"ice.friction_angle_deg", "ice.shear_slope"},
    };
    for (const auto& [input, result] : replaced_by) {
      const auto override_of_input = origins_.find(input);
      const auto fixed_result = origins_.find(result);
      if (override_of_input == origins_.end() || fixed_result == origins_.end()) continue;
      if (override_of_input->second.layer <= fixed_result->second.layer) continue;
      throw ConfigError(input, table_.find(input)->write(),
                        std::string("has no effect on ") + result + ", which " + fixed_result->second.where +
                            " fixes; set that key too, or leave it out there so that eq. 10 gives it",
                        override_of_input->second.where);
    }
  }

  Scenario scenario_;
  KeyTable table_{scenario_};
  int layer_ = 0;
  std::map<std::string, Origin> origins_;
  std::map<std::string, std::pair<std::string, std::string>> overlay_values_;  ///< key to value and where
};

std::size_t sectionDepth(const std::string& section) {
  return 1 + static_cast<std::size_t>(std::count(section.begin(), section.end(), '.'));
}

/// The lines that close one section and open another: `name:`, with those around it where they are new.
std::string sectionHeads(const std::string& before, const std::string& section) {
  std::string heads, outer;
  std::istringstream names(section);
  for (std::string name; std::getline(names, name, '.');) {
    const std::string indent = outer.empty() ? "\n" : std::string(2 * sectionDepth(outer), ' ');
    if (!outer.empty()) outer += '.';
    outer += name;
    const bool open = before == outer || before.rfind(outer + ".", 0) == 0;
    if (!open) heads += indent + name + ":\n";
  }
  return heads;
}

}  // namespace

Scenario loadScenario(const ScenarioSources& sources) {
  Composer composer;
  if (!sources.file.empty()) composer.applyFile(sources.file);
  for (const std::string& overlay : sources.overlays) composer.applyOverlay(overlay);
  composer.applySettings(sources.settings);
  return composer.finish(sources.file);
}

Scenario parseScenario(const std::string& yaml, const std::string& where) {
  Composer composer;
  composer.applyText(yaml, where);
  return composer.unchecked();
}

std::vector<std::pair<std::string, std::string>> keyValues(const Scenario& scenario) {
  Scenario copy = scenario;  // visit() hands out references that can be written to
  const KeyTable table(copy);
  std::vector<std::pair<std::string, std::string>> values;
  for (const Key& key : table.keys()) {
    const std::string yaml = key.write();
    values.emplace_back(key.fullName(), yaml.empty() ? "" : YAML::Load(yaml).Scalar());
  }
  return values;
}

std::string toYaml(const Scenario& scenario) {
  Scenario copy = scenario;  // visit() hands out references that can be written to
  const KeyTable table(copy);
  std::string yaml = std::string("# Effective scenario of brash_ice_rig ") + kVersion +
                     ": every key, with its meaning and its allowed interval or words.\n";
  std::string section;
  for (const Key& key : table.keys()) {
    if (key.section != section) {
      yaml += sectionHeads(section, key.section);
      section = key.section;
    }
    const std::string indent(section.empty() ? 0 : 2 * sectionDepth(section), ' ');
    const std::string value = key.write();
    yaml += indent;
    yaml += value.empty() ? "# " + key.name + " is not set: " + key.help + "\n"
                          : key.name + ": " + value + "  # " + key.help + "\n";
  }
  return yaml;
}

}  // namespace brash_ice_rig
