#include "brash_ice_rig/identify/run_library.h"

#include <algorithm>
#include <cassert>
#include <chrono>
#include <filesystem>
#include <stdexcept>

#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/output/progress_line.h"
#include "brash_ice_rig/study/claims.h"
#include "brash_ice_rig/study/run_directory.h"

namespace brash_ice_rig {
namespace {

using WallClock = std::chrono::steady_clock;

}  // namespace

RunLibrary::RunLibrary(const std::string& directory, const RunPoolOptions& pool)
    : directory_(std::filesystem::absolute(directory).lexically_normal().string()), pool_(pool) {
  makeDirectory(directory_);
  makeDirectory(directory_ + "/motions");
}

std::string RunLibrary::motionFile(const HoistPath& path) {
  std::string text = "time_s,hoist_position_m\n";
  for (std::size_t i = 0; i < path.time_s.size(); ++i) {
    text += formatNumber(path.time_s[i]) + "," + formatNumber(path.height_m[i]) + "\n";
  }
  std::string file = directory_ + "/motions/" + hashText(text) + ".csv";
  // Processes that share the directory write it at the same time, others read it already.
  if (!std::filesystem::exists(file)) {
    const std::string draft = file + "." + Claims(pool_.lease_s).name();
    replaceFile(draft, text);
    std::filesystem::rename(draft, file);
  }
  return file;
}

std::string RunLibrary::request(const Scenario& scenario) {
  std::string key = hashText(toYaml(scenario));
  if (rest_s_.emplace(key, scenario.procedure.rest_duration_s).second) {
    waiting_.push_back({directory_ + "/" + key, scenario});
    waiting_keys_.push_back(key);
  }
  return key;
}

void RunLibrary::makeMissing(const std::string& what) {
  if (waiting_.empty()) return;
  std::vector<RunStatus> statuses = findEarlierRuns(waiting_, pool_.program, false);
  std::size_t to_make = 0, finished = 0;
  for (const RunStatus& status : statuses) to_make += status.state == RunState::kWaiting ? 1 : 0;
  ProgressLine line;
  const auto start = WallClock::now();
  const auto tell = [&] {
    const double done = static_cast<double>(finished) / static_cast<double>(std::max<std::size_t>(to_make, 1));
    const double wall_s = std::chrono::duration<double>(WallClock::now() - start).count();
    return what + ": " + std::to_string(finished) + "/" + std::to_string(to_make) + " simulations " +
           progressBar(done, finished > 0 ? wall_s * (1.0 / done - 1.0) : -1.0);
  };
  line.print(what + ": " + std::to_string(waiting_.size()) + " simulations, " +
             std::to_string(waiting_.size() - to_make) + " of them made before");
  auto shown = start;
  pool_.changed = [&](std::size_t run) {
    if (statuses[run].state == RunState::kRunning || statuses[run].state == RunState::kWaiting) return;
    ++finished;
    // On a terminal the line is kept up to date; elsewhere every tenth run is news enough.
    if (!line.onTerminal() && (finished % 10 == 0 || finished == to_make)) line.print(tell());
  };
  pool_.tick = [&] {
    if (!line.onTerminal() || WallClock::now() - shown < std::chrono::milliseconds(200)) return;
    shown = WallClock::now();
    line.show(tell());
  };
  makeRuns(waiting_, pool_, statuses);
  line.end();
  made_ += finished;
  for (std::size_t i = 0; i < waiting_.size(); ++i) {
    if (statuses[i].state == RunState::kWaiting) throw Interrupted();
    if (statuses[i].state == RunState::kFailed) {
      // A full disk or a killed run says nothing about the parameters: an effect must not lose its place for that.
      if (!isFrozen(statuses[i].note)) throw OutputError(waiting_[i].directory, statuses[i].note);
      failed_[waiting_keys_[i]] = statuses[i].note;
    }
  }
  waiting_.clear();
  waiting_keys_.clear();
}

const SimulatedForce& RunLibrary::force(const std::string& key) {
  assert(std::find(waiting_keys_.begin(), waiting_keys_.end(), key) == waiting_keys_.end() && !failed(key));
  const auto known = forces_.find(key);
  if (known != forces_.end()) return known->second;
  return forces_.emplace(key, readSimulatedForce(directory_ + "/" + key, rest_s_.at(key))).first->second;
}

}  // namespace brash_ice_rig
