#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "brash_ice_rig/identify/clock_offset.h"
#include "brash_ice_rig/identify/record.h"

namespace brash_ice_rig {

enum class Severity {
  kNote,      ///< worth knowing; changes nothing
  kDegraded,  ///< usable, within the limits that the remedy tells
  kRefuse     ///< nothing can be identified from the record as it is
};

/// As it is told: note, limit, refused.
const char* severityName(Severity severity);

/// Something that a check found.
struct Finding {
  Severity severity = Severity::kNote;
  std::string code;                ///< a word, as listed in doc/records.md
  std::optional<std::size_t> row;  ///< of the record, where it shows first; empty: all of it
  std::string text;                ///< what is wrong
  std::string remedy;              ///< what can still be done
};

enum class RecordStageKind { kQuiet, kLowering, kLifting, kHolding };

/// A stretch in which the hoist does one thing. Rest before the first lift is quiet, rest after it holding.
struct RecordStage {
  RecordStageKind kind = RecordStageKind::kQuiet;
  double start_s = 0.0, end_s = 0.0;
};

enum class Usability { kYes, kWithLimits, kNo };

/// What checkRecord() found out. Without value: NaN or empty.
struct RecordReport {
  /// Rows to work with: every value is finite and time increases strictly.
  std::vector<std::size_t> rows;
  double start_s = std::numeric_limits<double>::quiet_NaN();
  double duration_s = 0.0;
  double rate_hz = std::numeric_limits<double>::quiet_NaN();       ///< from the median interval
  double peak_force_n = std::numeric_limits<double>::quiet_NaN();  ///< largest 1 s mean, tare taken off
  double peak_time_s = std::numeric_limits<double>::quiet_NaN();
  double noise_sigma_n = std::numeric_limits<double>::quiet_NaN();  ///< of the quiet stretch about its straight line
  double resolution_n = 0.0;                                        ///< step between readings; 0: none found
  double lift_m = 0.0;                                              ///< way up, from the first lift's start
  bool has_stops = false;                                           ///< the lift halts and goes on
  std::vector<RecordStage> stages;
  std::optional<ClockOffset> clock;
  std::vector<Finding> findings;  ///< the gravest first

  Usability usability() const;
};

/// Looks for everything that would spoil an identification. Never throws on what stands in a record.
RecordReport checkRecord(const Record& record);

/// The report for the people who made the record, several lines.
/// @param name  of the record
std::string describe(const std::string& name, const Record& record, const RecordReport& report);

}  // namespace brash_ice_rig
