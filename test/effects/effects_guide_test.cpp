// doc/effects.md says of each effect what the registry says.

#include <fstream>
#include <iterator>
#include <regex>
#include <string>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/effects/effect_registry.h"

namespace brash_ice_rig {
namespace {

std::string guide() {
  std::ifstream in(std::string(BRASH_ICE_SOURCE_DIR) + "/doc/effects.md");
  return std::string((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
}

/// The section under `## name`, up to the next one.
std::string sectionOf(const std::string& text, const std::string& name) {
  const auto begin = text.find("\n## " + name + "\n");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find("\n## ", begin + 1) - begin);
}

std::string rowOf(const EffectParameter& p) {
  const bool is_switch = p.kind == EffectParameter::Kind::kSwitch;
  const std::string value = is_switch ? (p.default_value != 0.0 ? "true" : "false") : formatNumber(p.default_value);
  const std::string prior =
      p.prior.kind == PriorKind::kNone
          ? ""
          : std::string(priorName(p.prior.kind)) + "(" + formatNumber(p.prior.a) + ", " + formatNumber(p.prior.b) + ")";
  const char* const role = p.role == ParameterRole::kAmplitude ? (p.linear ? "amplitude, linear" : "amplitude")
                           : p.role == ParameterRole::kShape   ? (p.tried ? "shape, tried" : "shape")
                                                               : "setting";
  return std::string("| `") + p.name + "` | " + p.unit + " | " + value + " | " +
         (is_switch ? "true, false" : formatRange(p.range)) + " | " + prior + " | " + role + " | ";
}

TEST(EffectsGuide, HasASectionForEachEffectWithARowForEachParameter) {
  const std::string text = guide();
  std::size_t parameters = 0;
  for (const EffectDescription& effect : effectRegistry()) {
    if (std::string(effect.name) == "divers_line") continue;  // this program's own, see own_effect_test.cpp
    const std::string section = sectionOf(text, effect.name);
    EXPECT_FALSE(section.empty()) << effect.name;
    for (const EffectParameter& p : effect.parameters) {
      ++parameters;
      EXPECT_NE(section.find("\n" + rowOf(p)), std::string::npos) << effect.name << ": " << rowOf(p);
    }
    for (const char* other : effect.confusable_with) {
      EXPECT_NE(section.find("`" + std::string(other) + "`"), std::string::npos) << effect.name << ": " << other;
    }
  }
  const std::regex row("\n\\| `[a-z0-9_]+` \\| [^|]*\\| [^|]+\\| [^|]+\\| [^|]*\\| (amplitude|shape|setting)");
  const std::ptrdiff_t rows =
      std::distance(std::sregex_iterator(text.begin(), text.end(), row), std::sregex_iterator());
  EXPECT_EQ(static_cast<std::size_t>(rows), parameters) << "rows of parameters that do not exist";
}

}  // namespace
}  // namespace brash_ice_rig
