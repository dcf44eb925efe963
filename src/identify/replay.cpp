#include "brash_ice_rig/identify/replay.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <utility>

#include "brash_ice_rig/config/input_file.h"
#include "brash_ice_rig/identify/measured_force.h"
#include "brash_ice_rig/identify/record_check.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/rig/collector.h"

namespace brash_ice_rig {
namespace {

namespace fs = std::filesystem;

/// Time over which the hoist's position is averaged, s: an encoder's steps, divided by a sample, would be speeds that
/// no crane has.
constexpr double kMotionIntervalS = 0.1;

std::string text(const char* format, double value) {
  char line[160];
  std::snprintf(line, sizeof line, format, value);
  return line;
}

std::string toCsv(const char* header, const std::vector<double>& time, const std::vector<double>& second,
                  const std::vector<double>& third = {}) {
  std::string csv = header;
  for (std::size_t i = 0; i < time.size(); ++i) {
    csv += toText(time[i]) + ',' + toText(second[i]);
    if (!third.empty()) csv += ',' + toText(third[i]);
    csv += '\n';
  }
  return csv;
}

/// The record's file into the replay's directory: records may move, and one made of a bag does not last.
std::string copyInto(const std::string& directory, const char* name, const std::string& source) {
  std::string target = directory + "/" + name;
  replaceFile(target, InputFile(source).read());
  return target;
}

/// What checkRecord() refuses, as one error.
RecordReport checked(const Record& record) {
  RecordReport report = checkRecord(record);
  if (report.usability() != Usability::kNo) return report;
  std::string reasons;
  for (const Finding& finding : report.findings) {
    if (finding.severity == Severity::kRefuse) reasons += "; " + finding.code + ": " + finding.text;
  }
  throw ConfigError("", "", "this record cannot be replayed" + reasons, record.csv_file);
}

/// Where the part that is replayed begins: the end of the last lowering before the first lift, or the first row.
double startOf(const RecordReport& report, bool& lowered) {
  double start = report.start_s;
  lowered = false;
  for (const RecordStage& stage : report.stages) {
    if (stage.kind == RecordStageKind::kLifting) break;
    if (stage.kind != RecordStageKind::kLowering) continue;
    start = stage.end_s;
    lowered = true;
  }
  return start;
}

struct Rows {
  std::vector<double> time_s, force_n, position_m;
};

/// The hoist's way as corners kMotionIntervalS apart.
Rows meanMotion(const Rows& rows) {
  Rows corners;
  for (std::size_t first = 0; first < rows.time_s.size();) {
    const double bin = std::floor(rows.time_s[first] / kMotionIntervalS);
    double time = 0.0, position = 0.0;
    std::size_t next = first;
    for (; next < rows.time_s.size() && std::floor(rows.time_s[next] / kMotionIntervalS) == bin; ++next) {
      time += rows.time_s[next];
      position += rows.position_m[next];
    }
    const auto count = static_cast<double>(next - first);
    corners.time_s.push_back(time / count);
    corners.position_m.push_back(position / count);
    first = next;
  }
  return corners;
}

/// Scenario of the record, then the changes of whoever replays it.
Scenario changed(const Scenario& scenario, const ScenarioSources& changes, const std::string& file) {
  replaceFile(file, toYaml(scenario));
  ScenarioSources sources = changes;
  sources.file = file;
  return loadScenario(sources);
}

void prepareForeign(const Record& record, const ScenarioSources& changes, const std::string& directory,
                    Replay& replay) {
  const RecordReport report = checked(record);
  bool lowered = false;
  const double start_s = startOf(report, lowered);
  Rows rows;
  for (const std::size_t row : report.rows) {
    if (record.time_s[row] < start_s) continue;
    rows.time_s.push_back(record.time_s[row] - start_s);
    rows.force_n.push_back(record.force_n[row]);
    rows.position_m.push_back(record.hoist_position_m[row]);
  }
  const Rows corners = meanMotion(rows);
  if (corners.time_s.size() < 2) {
    throw ConfigError("", "", "this record cannot be replayed: it ends where its lift should begin", record.csv_file);
  }
  replay.remarks.push_back(text("0 s of the replay is %.6g s of the record", start_s));
  if (lowered) replay.remarks.push_back("lowering and unfolding are left out: the replay begins below the ice");

  const std::string motion_file = directory + "/motion.csv";
  replaceFile(motion_file, toCsv("time_s,hoist_position_m\n", corners.time_s, corners.position_m));
  Scenario scenario = record.scenario;
  if (scenario.procedure.start == StartPose::kFoldedAboveIce) {
    const double lowest = lowestHubHeight(scenario);
    scenario.procedure.start = StartPose::kUnfoldedUnderIce;
    scenario.procedure.start_gap_m = 0.0;
    scenario.procedure.start_gap_m = std::max(0.0, startHubHeight(scenario) - lowest);
  }
  scenario.procedure.control = ControlMode::kScripted;
  scenario.procedure.motion_file = motion_file;
  scenario.procedure.hold_duration_s = 0.0;
  replay.scenario = changed(scenario, changes, replay.scenario_file);

  double late_s = 0.0;
  for (const Finding& finding : report.findings) {
    if (finding.code == "clock_offset" && report.clock) late_s = report.clock->offset_s;
  }
  if (late_s != 0.0) replay.remarks.push_back(text("the force comes %.2f s late in the record: taken off", late_s));
  const Scenario& s = replay.scenario;
  const Collector collector(s.collector, true);
  const double empty_n = collector.weight() - collector.buoyancy(startHubHeight(s), s.water.density_kgpm3);
  replay.remarks.push_back(text("the measured force has the simulated zero: %+.1f N", empty_n - record.tare_n));
  for (std::size_t i = 0; i < rows.time_s.size(); ++i) {
    replay.time_s.push_back(rows.time_s[i] - late_s);
    replay.force_n.push_back(rows.force_n[i] - record.tare_n + empty_n);
  }
  replaceFile(replay.measured_file,
              toCsv("time_s,force_n,hoist_position_m\n", replay.time_s, replay.force_n, rows.position_m));
}

void prepareOwn(const Record& record, const ScenarioSources& changes, const std::string& directory, Replay& replay) {
  Scenario scenario = record.scenario;
  scenario.procedure.commands_file = copyInto(directory, "commands.csv", record.commands_file);
  if (!record.motion_file.empty()) {
    scenario.procedure.motion_file = copyInto(directory, "motion.csv", record.motion_file);
  }
  replay.scenario = changed(scenario, changes, replay.scenario_file);
  std::vector<double> position;
  for (std::size_t i = 0; i < record.size(); ++i) {
    const bool usable = std::isfinite(record.time_s[i]) && std::isfinite(record.force_n[i]);
    if (!usable || (!replay.time_s.empty() && record.time_s[i] <= replay.time_s.back())) continue;
    replay.time_s.push_back(record.time_s[i]);
    replay.force_n.push_back(record.force_n[i]);
    position.push_back(record.hoist_position_m[i]);
  }
  if (replay.time_s.empty()) throw ConfigError("", "", "holds no row with a time and a force", record.csv_file);
  replaceFile(replay.measured_file,
              toCsv("time_s,force_n,hoist_position_m\n", replay.time_s, replay.force_n, position));
}

}  // namespace

Replay prepareReplay(const Record& record, const ScenarioSources& changes, const std::string& directory) {
  const std::string path = fs::absolute(directory).lexically_normal().string();
  makeDirectory(path);
  Replay replay;
  replay.exact = !record.commands_file.empty();
  replay.scenario_file = path + "/replay.yaml";
  replay.measured_file = path + "/measured.csv";
  if (replay.exact) {
    prepareOwn(record, changes, path, replay);
  } else {
    prepareForeign(record, changes, path, replay);
  }
  replaceFile(replay.scenario_file, toYaml(replay.scenario));
  return replay;
}

ReplayComparison compareForces(const Replay& replay, const std::vector<double>& time_s,
                               const std::vector<double>& force_n) {
  const MeasuredForce measured(replay.time_s, replay.force_n);
  ReplayComparison result;
  double sum = 0.0;
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    const std::optional<double> force = measured.at(time_s[i]);
    if (!force) continue;
    ++result.samples;
    const bool sampled = std::binary_search(replay.time_s.begin(), replay.time_s.end(), time_s[i]);
    if (sampled && *force == force_n[i]) ++result.identical;
    sum += (force_n[i] - *force) * (force_n[i] - *force);
  }
  if (result.samples > 0) result.rms_n = std::sqrt(sum / static_cast<double>(result.samples));
  return result;
}

}  // namespace brash_ice_rig
