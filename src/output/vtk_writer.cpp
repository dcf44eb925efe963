#include "brash_ice_rig/output/vtk_writer.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <numeric>
#include <utility>

#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/rig/collector.h"

namespace brash_ice_rig {
namespace {

constexpr std::size_t kArms = kArmCount;

std::string base64(const std::vector<unsigned char>& bytes) {
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t present = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < present ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += k <= present ? kDigits[group >> (18 - 6 * k) & 63u] : '=';
  }
  return text;
}

/// VTK's inline binary form: the length in bytes, then the values, in one base64 text.
template <class Value>
std::string dataArray(const char* type, const std::string& name, int components, const std::vector<Value>& values) {
  const std::uint64_t size = values.size() * sizeof(Value);
  std::vector<unsigned char> bytes(sizeof size + size);
  std::memcpy(bytes.data(), &size, sizeof size);
  if (size > 0) std::memcpy(bytes.data() + sizeof size, values.data(), size);
  return "<DataArray type=\"" + std::string(type) + "\" Name=\"" + name + "\" NumberOfComponents=\"" +
         std::to_string(components) + "\" format=\"binary\">" + base64(bytes) + "</DataArray>\n";
}

/// Cells of `points_per_cell` points each, under the element's name ("Verts", "Lines", "Polys").
std::string cells(const std::string& element, const std::vector<std::int64_t>& connectivity,
                  std::size_t points_per_cell) {
  std::vector<std::int64_t> offsets(connectivity.size() / points_per_cell);
  for (std::size_t i = 0; i < offsets.size(); ++i) offsets[i] = static_cast<std::int64_t>((i + 1) * points_per_cell);
  return "<" + element + ">\n" + dataArray("Int64", "connectivity", 1, connectivity) +
         dataArray("Int64", "offsets", 1, offsets) + "</" + element + ">\n";
}

std::string vtkFile(const std::string& type, const std::string& body) {
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
  const std::string byte_order = "LittleEndian";
#else
  const std::string byte_order = "BigEndian";
#endif
  return "<?xml version=\"1.0\"?>\n<VTKFile type=\"" + type + "\" version=\"1.0\" byte_order=\"" + byte_order +
         "\" header_type=\"UInt64\">\n" + body + "</VTKFile>\n";
}

std::string points(const std::vector<float>& xyz) {
  return "<Points>\n" + dataArray("Float32", "position_m", 3, xyz) + "</Points>\n";
}

std::string counts(std::size_t points, std::size_t verts, std::size_t lines, std::size_t polys) {
  return "<PolyData>\n<Piece NumberOfPoints=\"" + std::to_string(points) + "\" NumberOfVerts=\"" +
         std::to_string(verts) + "\" NumberOfLines=\"" + std::to_string(lines) + "\" NumberOfStrips=\"0\"" +
         " NumberOfPolys=\"" + std::to_string(polys) + "\">\n";
}

constexpr const char* kPieceEnd = "</Piece>\n</PolyData>\n";

void writeWhole(const std::string& path, const std::string& text) {
  OutputFile file(path, OutputFile::Mode::kReplace);
  file.write(text);
  file.close();
}

std::string numbered(const char* stem, std::size_t number) {
  char name[64];
  std::snprintf(name, sizeof name, "%s_%06zu.vtp", stem, number);
  return name;
}

}  // namespace

std::string particlesToVtp(const ParticleCloud& cloud) {
  const std::size_t count = cloud.size();
  std::vector<float> xyz;
  xyz.reserve(3 * count);
  for (std::size_t i = 0; i < count; ++i) xyz.insert(xyz.end(), {cloud.x_m[i], cloud.y_m[i], cloud.z_m[i]});
  std::vector<std::int64_t> vertices(count);
  std::iota(vertices.begin(), vertices.end(), 0);

  const std::array<std::pair<const char*, const std::vector<float>*>, 5> fields = {{
      {"speed_mps", &cloud.speed_mps},
      {"pressure_pa", &cloud.pressure_pa},
      {"plastic_strain", &cloud.plastic_strain},
      {"damage", &cloud.damage},
      {"submerged", &cloud.submerged},
  }};
  std::string data = "<PointData Scalars=\"plastic_strain\">\n";
  for (const auto& [name, values] : fields) {
    assert(values->size() == count);
    data += dataArray("Float32", name, 1, *values);
  }
  data += "</PointData>\n";
  return vtkFile("PolyData", counts(count, count, 0, 0) + data + points(xyz) + cells("Verts", vertices, 1) + kPieceEnd);
}

std::string collectorToVtp(const CollectorConfig& collector, const RigState& rig) {
  const Eigen::Vector3d hub(rig.crane_position_m.x(), rig.crane_position_m.y(), rig.hoist_position_m);

  std::vector<float> xyz;
  const auto add = [&xyz](const Eigen::Vector3d& p) {
    xyz.insert(xyz.end(), {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())});
  };
  std::vector<std::int64_t> triangles;
  for (std::size_t arm = 0; arm < kArms; ++arm) {
    add(hub + armTipOffset(collector, rig.arm_angle_rad, static_cast<int>(arm)));
    triangles.insert(triangles.end(), {static_cast<std::int64_t>(kArms), static_cast<std::int64_t>(arm),
                                       static_cast<std::int64_t>((arm + 1) % kArms)});
  }
  add(hub);
  add(rig.crane_position_m);
  const std::vector<std::int64_t> pole = {static_cast<std::int64_t>(kArms), static_cast<std::int64_t>(kArms + 1)};
  return vtkFile("PolyData", counts(kArms + 2, 0, 1, kArms) + points(xyz) + cells("Lines", pole, 2) +
                                 cells("Polys", triangles, 3) + kPieceEnd);
}

VtkWriter::VtkWriter(const std::string& directory) : directory_(directory) {
  makeDirectory(directory_);
}

void VtkWriter::write(double time_s, const ParticleCloud& cloud, const CollectorConfig& collector,
                      const RigState& rig) {
  const std::size_t number = times_s_.size();
  writeWhole(directory_ + "/" + numbered("ice", number), particlesToVtp(cloud));
  writeWhole(directory_ + "/" + numbered("collector", number), collectorToVtp(collector, rig));
  times_s_.push_back(time_s);

  std::string body = "<Collection>\n";
  for (std::size_t i = 0; i < times_s_.size(); ++i) {
    if (std::isnan(times_s_[i])) continue;
    const std::string time = "<DataSet timestep=\"" + toText(times_s_[i]) + "\" part=\"";
    body += time + "0\" name=\"ice\" file=\"" + numbered("ice", i) + "\"/>\n";
    body += time + "1\" name=\"collector\" file=\"" + numbered("collector", i) + "\"/>\n";
  }
  writeWhole(collectionPath(), vtkFile("Collection", body + "</Collection>\n"));
}

void VtkWriter::visitState(StateVisitor& visitor) {
  visitor.list("times_s", times_s_);
  visitor("due_s", due_s_);
  if (!visitor.loading()) return;
  for (std::size_t i = 0; i < times_s_.size(); ++i) {
    const bool there = std::filesystem::exists(directory_ + "/" + numbered("ice", i)) &&
                       std::filesystem::exists(directory_ + "/" + numbered("collector", i));
    if (!there) times_s_[i] = std::numeric_limits<double>::quiet_NaN();
  }
}

void VtkWriter::writeIfDue(const Simulation& simulation, const Snapshot& snapshot) {
  // Half a sample, so that round-off in the time does not shift an instant to the next sample.
  const double half_sample_s = 0.5 * simulation.samplePeriod();
  if (snapshot.time_s < due_s_ - half_sample_s) return;
  due_s_ = nextMultiple(simulation.scenario().output.vtk_interval_s, snapshot.time_s + half_sample_s);
  write(snapshot.time_s, simulation.particles(), simulation.scenario().collector, snapshot.rig);
}

}  // namespace brash_ice_rig
