#include "brash_ice_rig/output/vtk_writer.h"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <regex>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "temporary_directory.h"

namespace brash_ice_rig {
namespace {

/// Every element is closed, in order, and there is one root.
::testing::AssertionResult isWellFormed(const std::string& xml) {
  std::vector<std::string> open;
  std::size_t roots = 0;
  const std::regex tag("<(/?)([A-Za-z]+)((?: [A-Za-z_]+=\"[^\"<>]*\")*)(/?)>");
  std::size_t brackets = 0;
  for (const char c : xml) brackets += c == '<';
  std::size_t tags = xml.rfind("<?xml version=\"1.0\"?>", 0) == 0 ? 1 : 0;
  for (std::sregex_iterator match(xml.begin(), xml.end(), tag), end; match != end; ++match, ++tags) {
    const std::string name = (*match)[2];
    if ((*match)[1].length() > 0) {
      if (open.empty() || open.back() != name) return ::testing::AssertionFailure() << "stray </" << name << ">";
      open.pop_back();
    } else {
      if (open.empty()) ++roots;
      if ((*match)[4].length() == 0) open.push_back(name);
    }
  }
  if (tags != brackets) return ::testing::AssertionFailure() << "something that is no tag: " << tags << "/" << brackets;
  if (!open.empty()) return ::testing::AssertionFailure() << "<" << open.back() << "> is not closed";
  if (roots != 1) return ::testing::AssertionFailure() << roots << " roots";
  return ::testing::AssertionSuccess();
}

std::vector<unsigned char> decoded(const std::string& base64) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<unsigned char> bytes;
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : base64) {
    if (c == '=') break;
    bits = bits << 6 | static_cast<std::uint32_t>(digits.find(c));
    held += 6;
    if (held >= 8) bytes.push_back(static_cast<unsigned char>(bits >> (held -= 8)));
  }
  return bytes;
}

/// The values of the nth data array of that name.
template <class Value>
std::vector<Value> arrayNamed(const std::string& xml, const std::string& name, int nth = 0) {
  std::size_t at = xml.find("Name=\"" + name + "\"");
  for (; nth > 0 && at != std::string::npos; --nth) at = xml.find("Name=\"" + name + "\"", at + 1);
  if (at == std::string::npos) throw std::runtime_error("no array " + name);
  const std::size_t begin = xml.find('>', at) + 1;
  const std::vector<unsigned char> bytes = decoded(xml.substr(begin, xml.find('<', begin) - begin));
  std::uint64_t size = 0;
  std::memcpy(&size, bytes.data(), sizeof size);
  if (bytes.size() != sizeof size + size) throw std::runtime_error("length of " + name + " does not agree");
  std::vector<Value> values(size / sizeof(Value));
  if (size > 0) std::memcpy(values.data(), bytes.data() + sizeof size, size);
  return values;
}

std::size_t attribute(const std::string& xml, const std::string& name) {
  std::smatch match;
  if (!std::regex_search(xml, match, std::regex(name + "=\"([0-9]+)\""))) throw std::runtime_error("no " + name);
  return std::stoul(match[1]);
}

ParticleCloud threeParticles() {
  ParticleCloud cloud;
  cloud.x_m = {1.0f, 2.0f, 3.0f};
  cloud.y_m = {-1.0f, 0.0f, 1.0f};
  cloud.z_m = {0.1f, -0.5f, -1.08f};
  cloud.speed_mps = {0.0f, 0.052f, 0.01f};
  cloud.pressure_pa = {0.0f, 250.0f, 900.0f};
  cloud.plastic_strain = {0.0f, 0.02f, 0.3f};
  cloud.damage = {0.0f, 0.5f, 1.0f};
  cloud.submerged = {0.0f, 1.0f, 1.0f};
  return cloud;
}

TEST(VtkWriter, ParticlesComeBackWithTheirFields) {
  const ParticleCloud cloud = threeParticles();
  const std::string xml = particlesToVtp(cloud);
  EXPECT_TRUE(isWellFormed(xml));
  EXPECT_EQ(attribute(xml, "NumberOfPoints"), 3u);
  EXPECT_EQ(attribute(xml, "NumberOfVerts"), 3u);
  EXPECT_EQ(arrayNamed<float>(xml, "position_m"),
            (std::vector<float>{1.0f, -1.0f, 0.1f, 2.0f, 0.0f, -0.5f, 3.0f, 1.0f, -1.08f}));
  EXPECT_EQ(arrayNamed<float>(xml, "speed_mps"), cloud.speed_mps);
  EXPECT_EQ(arrayNamed<float>(xml, "pressure_pa"), cloud.pressure_pa);
  EXPECT_EQ(arrayNamed<float>(xml, "plastic_strain"), cloud.plastic_strain);
  EXPECT_EQ(arrayNamed<float>(xml, "damage"), cloud.damage);
  EXPECT_EQ(arrayNamed<float>(xml, "submerged"), cloud.submerged);
  EXPECT_EQ(arrayNamed<std::int64_t>(xml, "connectivity"), (std::vector<std::int64_t>{0, 1, 2}));
  EXPECT_EQ(arrayNamed<std::int64_t>(xml, "offsets"), (std::vector<std::int64_t>{1, 2, 3}));
}

TEST(VtkWriter, EmptyCloudIsAValidFile) {
  const std::string xml = particlesToVtp(ParticleCloud());
  EXPECT_TRUE(isWellFormed(xml));
  EXPECT_EQ(attribute(xml, "NumberOfPoints"), 0u);
  EXPECT_TRUE(arrayNamed<float>(xml, "position_m").empty());
}

TEST(VtkWriter, UnfoldedNetIsTheOctagonOfTheScenario) {
  CollectorConfig collector;
  RigState rig;
  rig.crane_position_m = {0.5, -0.25, 4.9};
  rig.hoist_position_m = -1.1;
  rig.arm_angle_rad = std::atan2(collector.rim_height_m, collector.radius_m);
  const std::string xml = collectorToVtp(collector, rig);
  EXPECT_TRUE(isWellFormed(xml));
  EXPECT_EQ(attribute(xml, "NumberOfPolys"), 8u);
  const std::vector<float> xyz = arrayNamed<float>(xml, "position_m");
  ASSERT_EQ(xyz.size(), 3 * attribute(xml, "NumberOfPoints"));
  for (std::size_t tip = 0; tip < 8; ++tip) {
    EXPECT_NEAR(std::hypot(xyz[3 * tip] - 0.5, xyz[3 * tip + 1] + 0.25), collector.radius_m, 1e-6);
    EXPECT_NEAR(xyz[3 * tip + 2], -1.1 + collector.rim_height_m, 1e-6);
  }
  EXPECT_EQ(xyz[3 * 8 + 2], -1.1f) << "hub";
  EXPECT_EQ(xyz[3 * 9 + 2], 4.9f) << "crane tip";
  const std::vector<std::int64_t> triangles = arrayNamed<std::int64_t>(xml, "connectivity", 1);
  ASSERT_EQ(triangles.size(), 24u);
  for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(triangles[3 * i], 8) << "each triangle starts at the hub";
}

TEST(VtkWriter, CollectionListsEachInstantWithFilesThatExist) {
  const TemporaryDirectory directory;
  VtkWriter writer(directory.file("vtk"));
  writer.write(-3.0, threeParticles(), CollectorConfig(), RigState());
  writer.write(0.5, threeParticles(), CollectorConfig(), RigState());
  const std::string xml = readFile(writer.collectionPath());
  EXPECT_TRUE(isWellFormed(xml));
  EXPECT_NE(xml.find("timestep=\"-3\""), std::string::npos);
  EXPECT_NE(xml.find("timestep=\"0.5\""), std::string::npos);
  const std::regex file("file=\"([^\"]+)\"");
  std::size_t files = 0;
  for (std::sregex_iterator match(xml.begin(), xml.end(), file), end; match != end; ++match, ++files) {
    EXPECT_TRUE(std::filesystem::exists(directory.file("vtk/" + (*match)[1].str())));
  }
  EXPECT_EQ(files, 4u);
}

}  // namespace
}  // namespace brash_ice_rig
