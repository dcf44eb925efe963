// The state in a checkpoint, forged so that every checksum is right: it is refused, or it is a world that goes on. An
// input is a list of changes to the file of a small world.

#include <algorithm>
#include <array>
#include <limits>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/effects/effect_registry.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/simulation/simulation.h"
#include "fuzz_input.h"
#include "sealed_checkpoint.h"

namespace brash_ice_rig {
namespace {

struct Field {
  std::string name;
  std::size_t element_size = 1;
  std::string content;
};

struct Section {
  std::string name;
  std::vector<Field> fields;
};

using Checkpoint = std::vector<Section>;

std::vector<Field> fieldsOf(const std::string& content) {
  std::vector<Field> fields;
  for (std::size_t at = 0; at < content.size();) {
    const auto name_length = valueAt<std::uint8_t>(content, at);
    Field field;
    field.name = content.substr(at + 1, name_length);
    at += 1 + name_length;
    field.element_size = valueAt<std::uint8_t>(content, at);
    const std::size_t bytes = valueAt<std::uint64_t>(content, at + 1) * field.element_size;
    field.content = content.substr(at + 9, bytes);
    at += 9 + bytes;
    fields.push_back(std::move(field));
  }
  return fields;
}

Checkpoint parse(const std::string& file) {
  Checkpoint sections;
  for (std::size_t at = kCheckpointHeader; at + kCheckpointTail < file.size();) {
    const std::size_t size = valueAt<std::uint64_t>(file, at + kCheckpointSectionName);
    const std::size_t begin = at + kCheckpointSectionName + sizeof(std::uint64_t);
    sections.push_back({std::string(file.c_str() + at), fieldsOf(file.substr(begin, size))});
    at = begin + size;
  }
  return sections;
}

template <class Value>
void append(std::string& text, const Value& value) {
  text.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string fileOf(const Checkpoint& sections) {
  std::string file(kCheckpointHeader, '\0');
  for (const Section& section : sections) {
    std::string content;
    for (const Field& field : section.fields) {
      append(content, static_cast<std::uint8_t>(field.name.size()));
      content += field.name;
      append(content, static_cast<std::uint8_t>(field.element_size));
      append(content, std::uint64_t{field.content.size() / field.element_size});
      content += field.content;
    }
    file += section.name + std::string(kCheckpointSectionName - section.name.size(), '\0');
    append(file, std::uint64_t{content.size()});
    file += content;
  }
  return sealed(std::move(file));
}

/// Simulation::stateHash() of what the section of the world holds.
std::uint64_t stateHashOf(const Section& world) {
  Hash hash;
  for (const Field& field : world.fields) {
    const std::uint64_t count = field.content.size() / field.element_size;
    hash.add(&count, sizeof count);
    hash.add(field.content.data(), field.content.size());
  }
  return hash.value();
}

Scenario smallScenario() {
  Scenario s;
  s.field.length_x_m = s.field.length_y_m = 2.4;
  s.field.thickness_m = 0.9;
  s.collector.radius_m = 0.6;
  s.collector.rim_height_m = 0.2;
  s.procedure.settle_duration_s = 0.05;
  s.procedure.lift_speed_mps = 0.3;
  s.procedure.lift_duration_s = 3.0;
  s.procedure.start_gap_m = 0.0;
  s.load_cell.noise_n = 10.0;
  s.load_cell.lag_s = 0.05;
  s.solver.stiffness_scale = 1.0e-4;
  s.solver.threads = 1;
  return s;
}

/// As it is saved in the lift, with the rig in contact.
Checkpoint saved(const FuzzDirectory& directory, const Scenario& scenario) {
  Simulation simulation(scenario);
  simulation.advance(0.3);
  const std::string path = directory.file("base.bin");
  simulation.save(path);
  std::ifstream in(path, std::ios::binary);
  return parse({std::istreambuf_iterator<char>(in), {}});
}

std::vector<Checkpoint> makeWorlds(const FuzzDirectory& directory) {
  Scenario plain = smallScenario(), rich = smallScenario();
  plain.output.energy = true;
  for (const char* name :
       {"drainage", "block_drop", "rate_dependence", "refreezing", "compliance", "load_cell_lag", "vessel_heave"}) {
    rich.effects[name].enabled = true;
  }
  rich.ice.damage = true;
  rich.solver.smoothing_length = SmoothingLength::kVariable;
  return {saved(directory, plain), saved(directory, rich)};
}

/// 12 bytes of the input.
struct Change {
  std::uint16_t field;
  std::uint8_t kind, size;
  std::uint64_t value;
};
constexpr std::size_t kChangeSize = 12;

/// Values that break arithmetic.
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::array<double, 8> kOddNumbers = {
    0.0, -1.0, 1.0e-310, 1.0e30, -1.0e300, kInfinity, -kInfinity, std::numeric_limits<double>::quiet_NaN()};

void makeChange(const Change& change, std::vector<Field>& fields) {
  Field& field = fields[change.field % fields.size()];
  const std::size_t count = field.content.size() / field.element_size;
  const std::size_t place = change.value >> 40;
  switch (change.kind % 4) {
    case 0:  // bytes somewhere
      for (std::size_t k = 0; k < 1u + change.size % 8u && !field.content.empty(); ++k) {
        field.content[(place + k) % field.content.size()] = static_cast<char>(change.value >> 8 * (k % 5));
      }
      break;
    case 1:  // an odd number as one element
      if (count > 0 && field.element_size % 4 == 0) {
        const double value = kOddNumbers[change.size % kOddNumbers.size()];
        const bool is_double = field.element_size == 8 || field.element_size == 24;
        const std::size_t number_size = is_double ? 8 : 4;
        const std::size_t at = place % (field.content.size() / number_size) * number_size;
        if (is_double) {
          setValueAt(field.content, at, value);
        } else {
          setValueAt(field.content, at, static_cast<float>(value));
        }
      }
      break;
    case 2:  // another length
      field.content.resize(field.element_size * (change.size % 2 == 0 ? change.value % 2048 : change.value % 4));
      break;
    case 3:  // everything the same
      for (std::size_t at = field.element_size; at + field.element_size <= field.content.size();
           at += field.element_size) {
        std::copy_n(field.content.begin(), field.element_size, field.content.begin() + static_cast<std::ptrdiff_t>(at));
      }
      break;
  }
}

}  // namespace
}  // namespace brash_ice_rig

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace brash_ice_rig;
  static const FuzzDirectory kDirectory;
  static const std::vector<Checkpoint> kWorlds = makeWorlds(kDirectory);
  if (size == 0) return 0;
  Checkpoint file = kWorlds[data[0] % kWorlds.size()];
  // scenario, world, books
  for (std::size_t at = 1; at + kChangeSize <= size && at < 16 * kChangeSize; at += kChangeSize) {
    Change change{};
    std::memcpy(&change.field, data + at, 2);
    std::memcpy(&change.kind, data + at + 2, 1);
    std::memcpy(&change.size, data + at + 3, 1);
    std::memcpy(&change.value, data + at + 4, 8);
    makeChange(change, file[change.size < 0xf0 ? 1 : 2].fields);
  }
  for (Field& field : file[2].fields) {
    if (field.name == "state_hash" && field.content.size() == 8) setValueAt(field.content, 0, stateHashOf(file[1]));
  }
  try {
    Simulation simulation = Simulation::load(kDirectory.write("forged.bin", fileOf(file)));
    simulation.advance(3.0 * simulation.timeStep());
    simulation.snapshot();
    simulation.particles();
    simulation.plug();
    simulation.plugOutline();
    if (!simulation.frozen()) simulation.save(kDirectory.file("again.bin"));
  } catch (const ConfigError&) {
  }
  return 0;
}
