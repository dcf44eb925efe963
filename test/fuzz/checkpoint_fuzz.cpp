// The file of a checkpoint: as it is, and with size and checksum set right, as a forger would.

#include <optional>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/simulation/checkpoint.h"
#include "fuzz_input.h"
#include "sealed_checkpoint.h"

namespace brash_ice_rig {
namespace {

/// One field of each kind.
struct Fields {
  double number = 0.0;
  bool yes = false;
  std::optional<double> may_be;
  std::vector<double> three = std::vector<double>(3);
  std::vector<float> any;
  std::string text;

  void visitState(StateVisitor& visitor) {
    visitor("number", number);
    visitor("yes", yes);
    visitor("may_be", may_be);
    visitor("three", three);
    visitor.list("any", any);
    visitor("text", text);
  }
};

void readAll(const std::string& path) {
  try {
    CheckpointReader file(path);
    if (!file.has("fields")) return;
    Fields fields;
    file.read("fields", [&](StateVisitor& visitor) { fields.visitState(visitor); });
    require(fields.three.size() == 3, "an array keeps its length");
    require(fields.any.size() * sizeof(float) + fields.text.size() <= file.size("fields"), "no more than is there");
  } catch (const ConfigError&) {
  }
}

}  // namespace
}  // namespace brash_ice_rig

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace brash_ice_rig;
  static const FuzzDirectory kDirectory;
  readAll(kDirectory.write("raw.bin", textOf(data, size)));
  readAll(kDirectory.write("sealed.bin", sealed(textOf(data, size))));
  return 0;
}
