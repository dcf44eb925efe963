#include <fstream>
#include <iterator>
#include <regex>
#include <string>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "brash_ice_rig/config/scenario_reader.h"
#include "config_files.h"
#include "key_lister.h"

namespace brash_ice_rig {
namespace {

// A row of doc/tuning.md reads `| `section.key` | default | allowed | source | prose |`.

TEST(TuningGuide, HasARowForEachKeyWithItsDefault) {
  std::ifstream in(sourceFile("doc/tuning.md"));
  const std::string guide((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const YAML::Node defaults = YAML::Load(toYaml(Scenario{}));
  for (const auto& [key, exact] : KeyLister{Scenario{}}.values) {
    const YAML::Node value = valueAt(defaults, key);
    const std::string shown = value.IsDefined() ? value.Scalar() : "eq. 10";
    EXPECT_NE(guide.find("\n| `" + key + "` | " + shown + " |"), std::string::npos) << key << ", default " << shown;
  }
}

TEST(TuningGuide, GivesTheRangeOfEachNumber) {
  std::ifstream in(sourceFile("doc/tuning.md"));
  const std::string guide((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  for (const KeyLister::Number& number : KeyLister{Scenario{}}.numbers) {
    SCOPED_TRACE(number.key);
    const std::regex row("\\| `" + number.key + "` \\| [^|]+ \\| ([\\[(])([^,|]+), ([^|]+)([\\])]) \\|");
    std::smatch found;
    if (!std::regex_search(guide, found, row)) {
      ADD_FAILURE() << "no range";
      continue;
    }
    EXPECT_EQ(std::stod(found[2].str()), number.range.min);
    EXPECT_EQ(std::stod(found[3].str()), number.range.max);
    EXPECT_EQ(found[1].str() == "(", number.range.min_open);
    EXPECT_EQ(found[4].str() == ")", number.range.max_open);
  }
}

TEST(TuningGuide, GivesTheWordsOfEachChoice) {
  std::ifstream in(sourceFile("doc/tuning.md"));
  const std::string guide((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const KeyLister keys{Scenario{}};
  for (const auto& [key, allowed] : keys.words) {
    const std::string row = "\n| `" + key + "` | " + allowed.substr(0, allowed.find(','));
    EXPECT_NE(guide.find(row + " | " + allowed + " |"), std::string::npos) << key << ": " << allowed;
  }
}

TEST(TuningGuide, HasNoRowForAKeyThatDoesNotExist) {
  std::ifstream in(sourceFile("doc/tuning.md"));
  const auto known = KeyLister{Scenario{}}.values;
  const std::regex row("^\\| `([^`]+)` \\|.*");
  std::size_t rows = 0;
  for (std::string line; std::getline(in, line);) {
    std::smatch found;
    if (!std::regex_match(line, found, row)) continue;
    ++rows;
    EXPECT_EQ(known.count(found[1].str()), 1u) << found[1].str();
  }
  EXPECT_EQ(rows, known.size());
}

}  // namespace
}  // namespace brash_ice_rig
