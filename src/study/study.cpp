#include "brash_ice_rig/study/study.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <thread>
#include <vector>

#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/output/directory_lock.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/output/progress_line.h"
#include "brash_ice_rig/study/claims.h"
#include "brash_ice_rig/study/results.h"
#include "brash_ice_rig/study/run_directory.h"
#include "brash_ice_rig/study/run_pool.h"
#include "brash_ice_rig/study/study_file.h"
#include "brash_ice_rig/system/child_process.h"
#include "brash_ice_rig/system/launcher.h"

namespace brash_ice_rig {
namespace {

using WallClock = std::chrono::steady_clock;

std::string minutes(double seconds) {
  char text[32];
  const long whole = std::lround(seconds);
  std::snprintf(text, sizeof text, "%ld:%02ld", whole / 60, whole % 60);
  return text;
}

/// Tells how far the study is: a line that is kept up to date on a terminal, else one line per finished run.
class StudyProgress {
 public:
  StudyProgress(const Study& study, const std::vector<RunStatus>& statuses, int at_a_time)
      : study_(study), statuses_(statuses), at_a_time_(at_a_time), started_(statuses.size()) {}

  /// What there is to do, before the first run.
  void announce() {
    std::map<std::string, std::size_t> reasons;
    std::size_t waiting = 0;
    for (const RunStatus& status : statuses_) {
      if (status.state != RunState::kWaiting) continue;
      ++waiting;
      if (!status.note.empty()) ++reasons[status.note];
    }
    std::string text = std::to_string(statuses_.size()) + " runs, " + std::to_string(statuses_.size() - waiting) +
                       " of them made before, " + std::to_string(at_a_time_) + " at a time";
    line_.print(text);
    for (const auto& [reason, count] : reasons) {
      line_.print("  " + std::to_string(count) + (count == 1 ? " is" : " are") + " made again: " + reason);
    }
  }

  void changed(std::size_t run) {
    if (statuses_[run].state == RunState::kRunning) {
      started_[run] = WallClock::now();
      return;
    }
    // Whoever made it tells, and knows how long it took.
    if (statuses_[run].elsewhere || statuses_[run].state == RunState::kWaiting) return;
    const double wall_s = std::chrono::duration<double>(WallClock::now() - started_[run]).count();
    ++made_;
    made_wall_s_ += wall_s;
    const bool failed = statuses_[run].state == RunState::kFailed;
    if (line_.onTerminal() && !failed) return;
    line_.print(std::to_string(finished()) + "/" + std::to_string(statuses_.size()) + "  " + nameOf(run) + " " +
                (failed ? "failed: " + statuses_[run].note : "done in " + minutes(wall_s)));
  }

  void tick() {
    const auto now = WallClock::now();
    if (!line_.onTerminal() || now - shown_ < std::chrono::milliseconds(200)) return;
    shown_ = now;
    const double done = static_cast<double>(finished()) / static_cast<double>(statuses_.size());
    std::string text = std::to_string(finished()) + "/" + std::to_string(statuses_.size()) + " " +
                       progressBar(done, secondsLeft(now)) + "   running:";
    for (std::size_t run = 0; run < statuses_.size(); ++run) {
      if (statuses_[run].state == RunState::kRunning) text += " " + nameOf(run);
    }
    line_.show(text);
  }

  void end() { line_.end(); }

  std::size_t finished() const {
    return static_cast<std::size_t>(std::count_if(statuses_.begin(), statuses_.end(), [](const RunStatus& status) {
      return status.state == RunState::kDone || status.state == RunState::kFailed;
    }));
  }

 private:
  std::string nameOf(std::size_t run) const {
    return study_.cases[study_.runs[run].case_index].name + "/" + std::to_string(study_.runs[run].seed);
  }

  /// From the mean of the runs made so far; < 0 as long as there is none.
  double secondsLeft(WallClock::time_point now) const {
    if (made_ == 0) return -1.0;
    const double mean_s = made_wall_s_ / static_cast<double>(made_);
    double work_s = 0.0;
    for (std::size_t run = 0; run < statuses_.size(); ++run) {
      if (statuses_[run].state == RunState::kWaiting) work_s += mean_s;
      if (statuses_[run].state != RunState::kRunning) continue;
      work_s += std::max(0.0, mean_s - std::chrono::duration<double>(now - started_[run]).count());
    }
    return work_s / at_a_time_;
  }

  const Study& study_;
  const std::vector<RunStatus>& statuses_;
  int at_a_time_;
  std::vector<WallClock::time_point> started_;
  std::size_t made_ = 0;
  double made_wall_s_ = 0.0;
  WallClock::time_point shown_;
  ProgressLine line_;
};

int mostThreads(const Study& study) {
  int most = 1;
  for (const StudyRun& run : study.runs) most = std::max(most, run.scenario.solver.threads);
  return most;
}

int defaultChildren(const Study& study) {
  return std::max(1, coreCount() / mostThreads(study));
}

/// What all processes that share a study must have in common: the program and every run.
std::string workOf(const Study& study, const std::string& program) {
  std::string all = toYaml(study);
  for (const StudyRun& run : study.runs) all += toYaml(run.scenario);
  return "study " + hashText(all) + ", " + programStamp(program);
}

/// Writes results.csv and the report, or leaves that to another process that shares the study.
/// @return whether all is as it should be, as far as this process has to tell
bool finish(const StudyOptions& options, bool shared, const Study& study, const std::vector<RunJob>& jobs,
            const std::string& directory, const std::vector<RunStatus>& statuses) {
  const std::string table = resultsCsv(study, directory, statuses), path = directory + "/results.csv";
  // Should whoever is at it die before the table stands, the next one begins.
  Claims claims(options.lease_s);
  while (claims.claim(directory) == Claims::Answer::kBusy) {
    if (shared && textOfFileIfThere(path) == table) return true;
    if (options.stop && options.stop()) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  if (shared && textOfFileIfThere(path) == table) return true;
  replaceFile(path, table);
  std::printf("%s/study.yaml\n%s\n", directory.c_str(), path.c_str());
  std::fflush(stdout);
  bool all_done = true;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    if (statuses[i].state != RunState::kFailed) continue;
    all_done = false;
    std::fprintf(stderr, "failed%s: %s: %s\n", statuses[i].earlier ? " before (--repeat-failed runs it again)" : "",
                 jobs[i].directory.c_str(), statuses[i].note.c_str());
  }
  const auto stop = [&] {
    claims.renew();
    return options.stop && options.stop();
  };
  if (options.report && !makeReport("study_report", directory, stop)) {
    std::fprintf(stderr, "the figures are in results.csv\n");
  }
  return all_done;
}

}  // namespace

bool runStudy(const StudyOptions& options) {
  const Study study = readStudy(options.file);
  const LaunchedTogether together = launchedTogether();
  RunPoolOptions pool;
  pool.stop = options.stop;
  pool.shared = options.shared || together.size > 1;
  pool.lease_s = options.lease_s;
  pool.children = options.children;
  if (pool.children == 0) pool.children = together.size > 1 ? 1 : defaultChildren(study);
  const std::string directory = std::filesystem::absolute(options.directory).lexically_normal().string();
  makeDirectory(directory);
  const auto tidyUp = [&] {
    // They belong to the study as it was; without them, nobody takes them for those of this one.
    for (const char* name : {"/results.csv", "/report.html"}) removeFile(directory + name);
    replaceFile(directory + "/study.yaml", toYaml(study));
  };
  std::optional<DirectoryLock> lock;
  if (pool.shared) {
    lock.emplace(directory, workOf(study, pool.program), tidyUp);
  } else {
    lock.emplace(directory);
    tidyUp();
  }

  std::vector<RunJob> jobs;
  for (const StudyRun& run : study.runs) jobs.push_back({directory + "/" + runDirectory(study, run), run.scenario});
  if (together.size > 1 && pool.children * mostThreads(study) > coreCount()) {
    std::fprintf(stderr, "this process is bound to %d core(s), too few for its runs: mpirun --bind-to none\n",
                 coreCount());
  }
  std::vector<RunStatus> statuses = findEarlierRuns(jobs, pool.program, options.repeat_failed);
  StudyProgress progress(study, statuses, pool.children * together.size);
  if (together.rank == 0) progress.announce();
  pool.changed = [&progress](std::size_t run) { progress.changed(run); };
  pool.tick = [&progress] { progress.tick(); };
  makeRuns(jobs, pool, statuses);
  progress.end();

  if (progress.finished() < jobs.size()) {
    std::fprintf(stderr, "interrupted: %zu of %zu runs are made; the same command makes the rest\n",
                 progress.finished(), jobs.size());
    return false;
  }
  return finish(options, pool.shared, study, jobs, directory, statuses);
}

}  // namespace brash_ice_rig
