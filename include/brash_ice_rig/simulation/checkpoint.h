#pragma once

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/system/state_visitor.h"

// A checkpoint is one file (doc/checkpoints.md):
//   magic, byte order, format version, size of the file     24 bytes
//   sections: name (24 bytes, zeros behind it), size (8 bytes), content; the first is the scenario as YAML
//   hash of all that comes before                            8 bytes
// The content of the other sections are fields: length of the name (1 byte), name, size of an element (1 byte), number
// of elements (8 bytes), elements.
namespace brash_ice_rig {

/// Puts a checkpoint together in memory and writes it.
class CheckpointWriter {
 public:
  CheckpointWriter(std::string path, const Scenario& scenario);

  /// Adds a section with all that `visit` walks.
  /// @param name  at most 24 characters, none twice
  void add(const std::string& name, const std::function<void(StateVisitor&)>& visit);

  /// Writes the file and waits until it is on the disk. It appears under its name complete or not at all; until then an
  /// older file of that name stays, whatever happens to this process or to the machine. Call once.
  /// @throws OutputError
  void commit();

  const std::string& path() const { return path_; }

 private:
  std::string path_;
  std::string content_;
};

/// Reads a checkpoint. The file is untrusted: nothing is allocated on its word alone.
class CheckpointReader {
 public:
  /// Checks the file as a whole: kind, byte order, version, size, hash, list of sections, each key of the scenario.
  /// @throws ConfigError naming file and reason
  explicit CheckpointReader(const std::string& path);

  const std::string& path() const { return path_; }
  /// That of the run that was saved; validate() it before use.
  const Scenario& scenario() const { return scenario_; }

  bool has(const std::string& section) const { return find(section) != nullptr; }
  /// Content of a section, bytes; 0 if there is none.
  std::uint64_t size(const std::string& section) const;

  /// Walks the fields of a section, which must be there and hold just these.
  /// @throws ConfigError
  void read(const std::string& section, const std::function<void(StateVisitor&)>& visit);

  [[noreturn]] void refuse(const std::string& reason) const;

 private:
  struct Section {
    std::string name;
    std::uint64_t begin, size;
  };
  const Section* find(const std::string& name) const;
  void listSections(std::uint64_t end);

  std::string path_;
  std::ifstream stream_;
  std::vector<Section> sections_;
  Scenario scenario_;
};

/// Whether a file begins as a checkpoint does, whatever its format version.
bool isCheckpoint(const std::string& path);

/// Name of the file that is written now and then.
constexpr char kCheckpointName[] = "checkpoint.bin";

}  // namespace brash_ice_rig
