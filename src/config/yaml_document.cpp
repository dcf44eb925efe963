#include "brash_ice_rig/config/yaml_document.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <sstream>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/edit_distance.h"
#include "brash_ice_rig/config/input_file.h"
#include "brash_ice_rig/config/number_check.h"

namespace brash_ice_rig {
namespace {

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

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

}  // namespace

YAML::Node readYamlMap(const std::string& path, const std::string& content) {
  const std::string text = InputFile(path).read(kMaxYamlBytes + 1);
  if (text.size() > kMaxYamlBytes) {
    throw ConfigError(
        "", "", "is larger than " + std::to_string(kMaxYamlBytes >> 20) + " MB, which no YAML file of ours is", path);
  }
  return parseYamlMap(text, path, content);
}

YAML::Node parseYamlMap(const std::string& text, const std::string& where, const std::string& content) {
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
    throw ConfigError("", "", "not valid YAML: " + error.msg, where + ":" + std::to_string(error.mark.line + 1));
  }
  if (!has_root) throw ConfigError("", "", "file is empty", where);
  if (!root.IsMap()) throw ConfigError("", "", "must be a map of " + content, where);
  if (has_more) throw ConfigError("", "", "must hold a single YAML document", where);
  return root;
}

void YamlItem::refuse(const std::string& rule) const {
  std::string shown;
  if (exists() && value.IsScalar()) shown = value.Scalar().empty() ? "\"\"" : value.Scalar();
  if (exists() && value.IsSequence()) shown = "[...]";
  if (exists() && value.IsMap()) shown = "{...}";
  throw ConfigError(key, shown, shown.empty() ? key + " " + rule : rule, where);
}

std::string YamlItem::text(const std::string& rule) const {
  if (!exists() || !value.IsScalar() || value.Scalar().empty()) refuse(rule);
  return value.Scalar();
}

double YamlItem::number(const Range& range) const {
  const std::string written = text("must be a number");
  const double result = numberFromText(key, written, where);
  checkRange(key, result, written, range, where);
  return result;
}

std::uint64_t YamlItem::wholeNumber(const Range& range) const {
  const double result = number(range);
  checkWholeNumber(key, value.Scalar(), where);
  return static_cast<std::uint64_t>(result);
}

std::string YamlItem::word(const std::vector<std::string>& words) const {
  std::string rule = "must be " + words.front();
  for (std::size_t i = 1; i < words.size(); ++i) rule += (i + 1 < words.size() ? ", " : " or ") + words[i];
  std::string written = text(rule);
  if (std::find(words.begin(), words.end(), written) == words.end()) refuse(rule);
  return written;
}

std::vector<YamlItem> YamlItem::list(const std::string& rule) const {
  if (!exists() || !value.IsSequence() || value.size() == 0) refuse(rule);
  std::vector<YamlItem> items;
  for (const YAML::Node& element : value) {
    items.push_back({"", key + "[" + std::to_string(items.size()) + "]", element, file, whereIs(element)});
  }
  return items;
}

std::vector<YamlItem> YamlItem::map(const std::string& rule) const {
  if (!exists() || !value.IsMap() || value.size() == 0) refuse(rule);
  std::vector<YamlItem> items;
  for (const auto& pair : value) {
    if (!pair.first.IsScalar()) throw ConfigError("", "", "each key must be a single word", whereIs(pair.first));
    const std::string& own_name = pair.first.Scalar();
    YamlItem item{own_name, key.empty() ? own_name : key + "." + own_name, pair.second, file, whereIs(pair.first)};
    const auto same = [&](const YamlItem& other) { return other.name == own_name; };
    if (std::any_of(items.begin(), items.end(), same)) {
      throw ConfigError(item.key, "", item.key + " is given twice", item.where);
    }
    items.push_back(std::move(item));
  }
  return items;
}

std::string YamlItem::whereIs(const YAML::Node& node) const {
  return file + ":" + std::to_string(node.Mark().line + 1);
}

YamlSection::YamlSection(const YamlItem& map, const std::vector<std::string>& allowed)
    : map_(map), items_(map.map("must be a map with the keys " + joined(allowed))) {
  for (const YamlItem& item : items_) {
    if (std::find(allowed.begin(), allowed.end(), item.name) != allowed.end()) continue;
    throw ConfigError(item.key, "",
                      "unknown key " + item.key + "; did you mean " + nearestWord(allowed, item.name) + "?",
                      item.where);
  }
}

YamlItem YamlSection::operator[](const std::string& name) const {
  for (const YamlItem& item : items_) {
    if (item.name == name) return item;
  }
  const std::string key = map_.key.empty() ? name : map_.key + "." + name;
  return {name, key, YAML::Node(YAML::NodeType::Undefined), map_.file, map_.where};
}

}  // namespace brash_ice_rig
