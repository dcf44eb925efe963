#pragma once

#include <string>

#include <yaml-cpp/node/node.h>

namespace brash_ice_rig {

/// Reads a file that holds one YAML document with a map at its top.
/// @param content  what the map should hold, for the message: "must be a map of " + content
/// @throws ConfigError if the file cannot be read, is empty, is not valid YAML, or holds anything else
YAML::Node readYamlMap(const std::string& path, const std::string& content);

}  // namespace brash_ice_rig
