#include "brash_ice_rig/config/yaml_document.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <system_error>

#include "brash_ice_rig/config/config_error.h"

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

}  // namespace

YAML::Node readYamlMap(const std::string& path, const std::string& content) {
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
  if (!root.IsMap()) throw ConfigError("", "", "must be a map of " + content, path);
  if (has_more) throw ConfigError("", "", "must hold a single YAML document", path);
  return root;
}

}  // namespace brash_ice_rig
