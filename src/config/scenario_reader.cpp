#include "brash_ice_rig/config/scenario_reader.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <locale>
#include <map>
#include <numeric>
#include <optional>
#include <sstream>
#include <type_traits>
#include <utility>
#include <vector>

#include "brash_ice_rig/version.h"
#include "number_check.h"

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

std::string lowerCase(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// YAML's and C's spellings of what is no finite number.
bool isNonFiniteWord(const std::string& text) {
  const std::string word = lowerCase(text.substr(std::min(text.find_first_not_of("+-."), text.size())));
  return word == "nan" || word == "inf" || word == "infinity";
}

double parseNumber(const Entry& entry) {
  entry.requireScalar("must be a number");
  std::istringstream in(entry.text);
  in.imbue(std::locale::classic());
  double value = 0.0;
  in >> std::noskipws >> value;
  const bool overflow = in.fail() && std::abs(value) == std::numeric_limits<double>::max();
  if (overflow || isNonFiniteWord(entry.text)) entry.refuse("must be a finite number");
  if (in.fail() || in.peek() != std::istringstream::traits_type::eof()) entry.refuse("must be a number");
  return value;
}

template <class Number>
Number parseNumber(const Entry& entry, const Range& range) {
  const double value = parseNumber(entry);
  if constexpr (std::is_integral_v<Number>) {
    if (entry.text.find_first_not_of("+-0123456789") != std::string::npos) entry.refuse("must be a whole number");
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
  std::string section;  ///< empty at the top level
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
    sections_.push_back(name);
    section_ = name;
    section.visit(*this);
    section_.clear();
  }

 private:
  void add(std::string name, std::string help, std::function<void(const Entry&)> read,
           std::function<std::string()> write) {
    keys_.push_back({section_, std::move(name), std::move(help), std::move(read), std::move(write)});
  }

  std::string section_;
  std::vector<std::string> sections_;
  std::vector<Key> keys_;
};

// ---- unknown keys

/// Fewest insertions, deletions and replacements of one letter that turn one word into the other.
int editDistance(const std::string& from, const std::string& to) {
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

/// Nearest known key or section. The right name in a wrong section, or without one, counts as two wrong letters;
/// letters that are wrong in it count twice, because short names all resemble each other.
std::string nearestName(const KeyTable& table, const std::string& unknown) {
  const std::string unknown_leaf = unknown.substr(unknown.rfind('.') + 1);
  std::string nearest;
  int least = std::numeric_limits<int>::max();
  const auto consider = [&](const std::string& candidate, int distance) {
    if (distance >= least) return;
    least = distance;
    nearest = candidate;
  };
  for (const std::string& section : table.sections()) consider(section, editDistance(unknown, section));
  for (const Key& key : table.keys()) {
    const int elsewhere = 2 + 2 * editDistance(unknown_leaf, key.name);
    consider(key.fullName(), std::min(editDistance(unknown, key.fullName()), elsewhere));
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

/// Runs the parser over a document without keeping anything of it.
class IgnoreEvents : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}
};

std::vector<Entry> readFile(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) throw ConfigError("", "", "is a directory, not a file", path);
  std::ifstream in(path, std::ios::binary);
  if (!in) throw ConfigError("", "", std::string("file cannot be read: ") + std::strerror(errno), path);
  const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());

  YAML::Node root;
  bool has_root = false;
  bool has_more = false;
  try {
    // Not LoadAll(): up to yaml-cpp 0.7 it finds documents without end in a text such as ",a".
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    IgnoreEvents ignore;
    has_root = parser.HandleNextDocument(ignore);
    has_more = has_root && parser.HandleNextDocument(ignore);
    root = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw ConfigError("", "", "not valid YAML: " + error.msg, path + ":" + std::to_string(error.mark.line + 1));
  }
  if (!has_root) throw ConfigError("", "", "file is empty", path);
  if (!root.IsMap()) {
    throw ConfigError("", "", "must be a map of sections, such as `field:` with indented `spacing_m: 0.3`", path);
  }
  if (has_more) throw ConfigError("", "", "must hold a single YAML document", path);
  std::vector<Entry> entries;
  flatten(root, "", path, entries);
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
      throw ConfigError(entry.key, "",
                        "unknown key " + entry.key + "; did you mean " + nearestName(table_, entry.key) + "?",
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

}  // namespace

Scenario loadScenario(const ScenarioSources& sources) {
  Composer composer;
  composer.applyFile(sources.file);
  for (const std::string& overlay : sources.overlays) composer.applyOverlay(overlay);
  composer.applySettings(sources.settings);
  return composer.finish(sources.file);
}

std::string toYaml(const Scenario& scenario) {
  Scenario copy = scenario;  // visit() hands out references that can be written to
  const KeyTable table(copy);
  std::string yaml = std::string("# Effective scenario of brash_ice_rig ") + kVersion +
                     ": every key, with its meaning and its allowed interval or words.\n";
  std::string section;
  for (const Key& key : table.keys()) {
    if (key.section != section) {
      section = key.section;
      yaml += "\n" + section + ":\n";
    }
    const std::string indent = section.empty() ? "" : "  ";
    const std::string value = key.write();
    yaml += value.empty() ? indent + "# " + key.name + " is not set: " + key.help + "\n"
                          : indent + key.name + ": " + value + "  # " + key.help + "\n";
  }
  return yaml;
}

}  // namespace brash_ice_rig
