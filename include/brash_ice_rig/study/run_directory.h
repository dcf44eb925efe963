#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "brash_ice_rig/config/scenario.h"

namespace brash_ice_rig {

// The directory of one run of a study: what `brash_ice run` leaves there, log.txt with what it printed, and program.txt
// with what identifies the program.

/// Columns or keys with their values, in the order of the file.
using Table = std::vector<std::pair<std::string, std::string>>;

/// What an earlier attempt has left.
struct EarlierRun {
  enum class State {
    kNone,       ///< nothing that counts: the run has to be made
    kDone,       ///< complete, of the same scenario, by the same program
    kNotFinite,  ///< the same, but the world froze: repeating it would give the same
  };
  State state = State::kNone;
  std::string note;  ///< kNone: why what is there does not count, empty if there is nothing; kNotFinite: the status
};

/// Whether a status of summary.json says that the world froze.
bool isFrozen(const std::string& status);

/// @param stamp  of the program that would make the run, see programStamp()
EarlierRun findEarlierRun(const std::string& directory, const Scenario& scenario, const std::string& stamp);

/// Makes a directory ready for a run: no summary from before, scenario.yaml, program.txt.
/// @param scenario_yaml  of toYaml()
/// @throws OutputError
void prepareRun(const std::string& directory, const std::string& scenario_yaml, const std::string& stamp);

/// One line that differs between programs: version and a 64-bit FNV-1a hash of the file.
/// @throws OutputError if the file cannot be read
std::string programStamp(const std::string& program);

/// 64-bit FNV-1a hash (Fowler, Noll, Vo; RFC 9923) of a text's bytes.
std::uint64_t fnv1a(const std::string& bytes);

/// The same as 16 hexadecimal digits.
std::string hashText(const std::string& bytes);

/// summary.json, numbers as they are written there and null as empty text.
/// @throws OutputError if it is not there or not whole
Table readSummary(const std::string& directory);

/// The value of a key; empty if the table does not have it.
std::string valueOf(const Table& table, const std::string& key);

/// The last row of plug.csv; no values if it has no row yet.
/// @throws OutputError if it cannot be read
Table readLastPlug(const std::string& directory);

/// The last line of log.txt that is not empty; empty if there is none.
std::string lastLogLine(const std::string& directory);

}  // namespace brash_ice_rig
