#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "brash_ice_rig/config/scenario_reader.h"

namespace brash_ice_rig {

/// Path of a file of the package.
inline std::string sourceFile(const std::string& relative) {
  return std::string(BRASH_ICE_SOURCE_DIR) + "/" + relative;
}

/// The YAML files of a folder of the package, sorted. What is added there is tested without further ado.
inline std::vector<std::string> shippedFiles(const std::string& folder) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(sourceFile(folder))) {
    if (entry.path().extension() == ".yaml") files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Writes a file for one test; tests run side by side, so its name starts with theirs.
inline std::string writeFile(const std::string& name, const std::string& content) {
  const ::testing::TestInfo* test = ::testing::UnitTest::GetInstance()->current_test_info();
  const std::string path = ::testing::TempDir() + test->test_suite_name() + "_" + test->name() + "_" + name;
  std::ofstream(path, std::ios::binary) << content;
  return path;
}

/// The value of a key, however deep its section; not defined where the document lacks it.
inline YAML::Node valueAt(const YAML::Node& document, const std::string& key) {
  const auto dot = key.find('.');
  const YAML::Node value = document[key.substr(0, dot)];
  if (dot == std::string::npos || !value.IsDefined()) return value;
  return valueAt(value, key.substr(dot + 1));
}

/// What the user gets to read; fails the test if nothing was refused.
inline std::string refusal(const ScenarioSources& sources) {
  try {
    loadScenario(sources);
  } catch (const ConfigError& error) {
    return error.what();
  }
  ADD_FAILURE() << "accepted";
  return "";
}

}  // namespace brash_ice_rig
