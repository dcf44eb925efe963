#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/config/scenario_reader.h"

namespace brash_ice_rig {

enum class RecordSource { kField, kLab, kSynthetic };
/// As in the manifest.
const char* sourceName(RecordSource source);
enum class PositionOrigin { kMeasured, kCommanded };

/// A property of the ice that somebody measured or knows otherwise.
struct KnownValue {
  std::string key;              ///< of the scenario, e.g. field.thickness_m
  double value = 0.0;           ///< in the key's unit and range
  std::optional<double> sigma;  ///< standard deviation, same unit, > 0; empty: not known
};

/// A measured pull-up test: what doc/records.md calls a record.
struct Record {
  std::string csv_file, manifest_file;

  // The manifest.
  std::string title;
  RecordSource source = RecordSource::kField;
  double tare_n = 0.0;  ///< reading of the empty rig hanging in the water; force_n still contains it
  PositionOrigin position = PositionOrigin::kMeasured;
  std::vector<KnownValue> ice;
  std::string notes;
  std::string commands_file;  ///< the record is a run of ours, which these commands repeat exactly; empty: it is not
  std::string motion_file;    ///< procedure.motion_file of that run; empty: it had none
  ScenarioSources sources;    ///< what `rig` and `ice` say: a file or none, and settings
  Scenario scenario;          ///< composed from these, defaults elsewhere

  std::vector<std::string> assumptions;     ///< what the files left open and how it was filled, a sentence each
  std::vector<std::string> unused_columns;  ///< of the CSV file

  // Samples as they are in the file, wrong ones too (checkRecord() finds those). All of one length, at least 1; the
  // optional columns of force and command are empty where the file lacks them.
  std::vector<std::size_t> line;         ///< in the file, from 1
  std::vector<double> time_s;            ///< start arbitrary
  std::vector<double> force_n;           ///< tension, > 0 when the rig pulls down on the crane; NaN: no reading
  std::vector<double> hoist_position_m;  ///< height of the hub over the waterline, up positive; derived if not given
  std::vector<double> hoist_speed_mps;   ///< up positive; derived if not given
  std::vector<double> force_x_n, force_y_n, hoist_command_mps;
  bool position_given = false;  ///< hoist_position_m is a column of the file

  std::size_t size() const { return time_s.size(); }
};

/// Reads NAME.csv and NAME.yaml.
/// @param path  of either file, of both without the ending, or of a directory that holds one such pair
/// @throws ConfigError naming file, line, key, value and rule: whatever readCsv() refuses, a missing file, no column
///   time_s, force_n or of motion, an unknown key in the manifest, a wrong type, a value out of range
Record readRecord(const std::string& path);

/// Whether a path is that of a record, by its content: a directory, a CSV file with a column of a record (or named
/// .csv), a YAML file with a key that only manifests have, or a name that becomes one of these with its ending.
bool isRecord(const std::string& path);

/// Least-squares slope of y over t in a window of ±0.1 s around each sample, wide enough for 3 samples at least: as
/// long as the ramps of a hoist, so that its starts and stops stay where they are. NaN
/// where the window has no two different times. Samples that are not finite do not count.
/// @param time_s  not decreasing where it is finite
std::vector<double> computeSmoothSlope(const std::vector<double>& time_s, const std::vector<double>& y);

}  // namespace brash_ice_rig
