#include "brash_ice_rig/study/run_pool.h"

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <deque>
#include <exception>
#include <memory>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/study/claims.h"
#include "brash_ice_rig/study/run_directory.h"
#include "brash_ice_rig/system/child_process.h"

namespace brash_ice_rig {
namespace {

using WallClock = std::chrono::steady_clock;

/// Long for a program that looks at its watch, short for people, nothing for the cores.
constexpr std::chrono::milliseconds kPollInterval{20};

/// Between looks at what other processes have at work.
constexpr std::chrono::milliseconds kLookInterval{1000};

/// What a child gets to end by itself before it is killed.
constexpr std::chrono::seconds kGrace{10};

/// A pipe into which nobody writes. Children have its outlet as their standard input and stop when it is closed, which
/// the system does when this process ends in whatever way. (Linux could send them a signal instead, but it does so when
/// the thread that started them ends.)
class Lifeline {
 public:
  Lifeline() {
    // Children must not inherit the inlet: it would stay open.
    if (pipe2(ends_, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
  }
  ~Lifeline() {
    close(ends_[0]);
    close(ends_[1]);
  }
  Lifeline(const Lifeline&) = delete;
  Lifeline& operator=(const Lifeline&) = delete;
  int outlet() const { return ends_[0]; }

 private:
  int ends_[2] = {-1, -1};
};

RunStatus failed(const std::string& why) {
  return {RunState::kFailed, why, false, false};
}

/// What became of a run, from how its child ended and what it left.
RunStatus outcome(const std::string& directory, const ChildEnd& end) {
  std::string status;
  try {
    status = valueOf(readSummary(directory), "status");
  } catch (const std::exception& error) {
    if (end.success()) return failed(error.what());
  }
  if (end.success()) return {RunState::kDone, "", false, false};
  // With a summary the program itself knows best: interrupted, or the world froze.
  if (!status.empty()) return failed(status);
  const std::string last = lastLogLine(directory);
  return failed(end.text() + (last.empty() ? "" : ", last line of its log: " + last));
}

/// The children of this process.
class Children {
 public:
  struct Result {
    std::size_t job;
    RunStatus status;
  };

  explicit Children(const RunPoolOptions& options) : options_(options), stamp_(programStamp(options.program)) {
    assert(options.children > 0);
  }

  const std::string& stamp() const { return stamp_; }
  bool hasRoom() const { return running_.size() < static_cast<std::size_t>(options_.children); }
  bool empty() const { return running_.empty() && results_.empty(); }

  /// A run that cannot be started is one more result.
  void start(std::size_t job, const std::string& directory, const std::string& scenario_yaml) {
    ChildSetup setup;
    setup.program = options_.program;
    setup.arguments = {"run", directory + "/scenario.yaml", "--out", directory, "--stop-when-stdin-closes"};
    setup.log_file = directory + "/log.txt";
    setup.standard_input = lifeline_.outlet();
    try {
      prepareRun(directory, scenario_yaml, stamp_);
      running_.push_back({job, directory, std::make_unique<ChildProcess>(setup)});
    } catch (const std::exception& error) {
      results_.push_back({job, failed(error.what())});
    }
  }

  /// Results since the last call.
  std::vector<Result> collect() {
    std::vector<Result> results = std::exchange(results_, {});
    for (auto child = running_.begin(); child != running_.end();) {
      const std::optional<ChildEnd> end = child->process->poll();
      if (!end) {
        ++child;
        continue;
      }
      results.push_back({child->job, outcome(child->directory, *end)});
      child = running_.erase(child);
    }
    return results;
  }

  /// Kills the run in a directory. @return its job; empty if none is at work there
  std::optional<std::size_t> abandon(const std::string& directory) {
    for (auto child = running_.begin(); child != running_.end(); ++child) {
      if (child->directory != directory) continue;
      const std::size_t job = child->job;
      running_.erase(child);
      return job;
    }
    return std::nullopt;
  }

  /// Ends all; they leave a summary that says so.
  void stop() {
    for (Child& child : running_) child.process->sendSignal(SIGTERM);
    const auto deadline = std::chrono::steady_clock::now() + kGrace;
    for (Child& child : running_) {
      const auto left = deadline - std::chrono::steady_clock::now();
      child.process->wait(std::chrono::duration_cast<std::chrono::milliseconds>(left));
    }
    running_.clear();  // kills what is left
  }

 private:
  struct Child {
    std::size_t job;
    std::string directory;
    std::unique_ptr<ChildProcess> process;
  };

  const RunPoolOptions& options_;
  std::string stamp_;
  Lifeline lifeline_;
  std::vector<Child> running_;
  std::vector<Result> results_;
};

bool wantsStop(const RunPoolOptions& options) {
  return options.stop && options.stop();
}

/// The jobs that are not done yet, of which other processes may make some at the same time.
class SharedJobs {
 public:
  SharedJobs(const std::vector<RunJob>& jobs, const RunPoolOptions& options, std::vector<RunStatus>& statuses)
      : jobs_(jobs),
        options_(options),
        statuses_(statuses),
        claims_(options.lease_s),
        children_(options),
        old_failures_(jobs.size()) {
    for (std::size_t job = 0; job < jobs.size(); ++job) {
      if (statuses[job].state != RunState::kWaiting) continue;
      waiting_.push_back(job);
      old_failures_[job] = failureIn(job);
    }
    // Many processes need not all ask for the same directory first.
    if (options.shared && !waiting_.empty()) {
      const auto first = static_cast<std::ptrdiff_t>(fnv1a(claims_.name()) % waiting_.size());
      std::rotate(waiting_.begin(), waiting_.begin() + first, waiting_.end());
    }
  }

  bool finished() const { return waiting_.empty() && elsewhere_.empty() && children_.empty(); }

  /// Books what has ended and starts what there is room for.
  void update() {
    for (const Children::Result& result : children_.collect()) bookOwn(result);
    for (const std::string& directory : claims_.renew()) {
      if (const auto job = children_.abandon(directory)) giveUp(*job);
    }
    if (!elsewhere_.empty() && WallClock::now() - looked_ > kLookInterval) {
      looked_ = WallClock::now();
      waiting_.insert(waiting_.end(), elsewhere_.begin(), elsewhere_.end());
      elsewhere_.clear();
    }
    while (!waiting_.empty() && children_.hasRoom() && !wantsStop(options_)) {
      const std::size_t job = waiting_.front();
      waiting_.pop_front();
      tryToStart(job);
      claims_.renew();
    }
  }

  /// Ends what is at work here. A Ctrl-C reaches the children, too: that they did not finish is no failure.
  void stop() {
    for (const Children::Result& result : children_.collect()) {
      if (result.status.state == RunState::kDone) bookOwn(result);
    }
    children_.stop();
    for (RunStatus& status : statuses_) {
      if (status.state == RunState::kRunning) status.state = RunState::kWaiting;
    }
  }

 private:
  void changeTo(std::size_t job, const RunStatus& status) {
    statuses_[job] = status;
    options_.changed(job);
  }

  /// Whoever has taken this job over makes it from its beginning.
  void giveUp(std::size_t job) {
    changeTo(job, {RunState::kWaiting, "", false, false});
    elsewhere_.push_back(job);
  }

  std::string failurePath(std::size_t job) const { return jobs_[job].directory + "/failure.txt"; }

  std::string failureIn(std::size_t job) const { return textOfFileIfThere(failurePath(job)); }

  void bookOwn(const Children::Result& result) {
    if (result.status.state == RunState::kFailed) {
      // The name makes it another text than that of an earlier failure. Where it cannot be written, others try, too.
      try {
        replaceFile(failurePath(result.job), claims_.name() + "\n" + result.status.note + "\n");
      } catch (const OutputError&) {
      }
    }
    if (claims_.release(jobs_[result.job].directory)) {
      changeTo(result.job, result.status);
    } else {
      giveUp(result.job);
    }
  }

  /// What another process has made of a job since we began; empty if nothing.
  std::optional<RunStatus> resultFromElsewhere(std::size_t job) const {
    const RunJob& run = jobs_[job];
    const EarlierRun found = findEarlierRun(run.directory, run.scenario, children_.stamp());
    const std::string failure = failureIn(job);
    if (!failure.empty() && failure != old_failures_[job]) {
      const auto note = failure.find('\n') + 1;
      return RunStatus{RunState::kFailed, failure.substr(note, failure.find_last_not_of('\n') + 1 - note), false, true};
    }
    if (found.state == EarlierRun::State::kDone) return RunStatus{RunState::kDone, "", false, true};
    return std::nullopt;
  }

  void tryToStart(std::size_t job) {
    const std::string& directory = jobs_[job].directory;
    try {
      makeDirectory(directory);
      if (!Claims::isClaimed(directory)) {
        if (const auto result = resultFromElsewhere(job)) return changeTo(job, *result);
      }
      const Claims::Answer answer = claims_.claim(directory);
      if (answer == Claims::Answer::kBusy) return elsewhere_.push_back(job);
      // It may have been finished between the look and the claim.
      if (answer == Claims::Answer::kMine) {
        if (const auto result = resultFromElsewhere(job)) {
          claims_.release(directory);
          return changeTo(job, *result);
        }
      }
      // Its last owner may not be as dead as it seemed: these it would go on to write in place.
      if (answer == Claims::Answer::kInherited) {
        for (const char* name : {"/force.csv", "/plug.csv"}) removeFile(directory + name);
      }
      changeTo(job, {RunState::kRunning, "", false, false});
      children_.start(job, directory, toYaml(jobs_[job].scenario));
    } catch (const std::exception& error) {
      claims_.release(directory);
      changeTo(job, failed(error.what()));
    }
  }

  const std::vector<RunJob>& jobs_;
  const RunPoolOptions& options_;
  std::vector<RunStatus>& statuses_;
  Claims claims_;  // given back when the children have ended
  Children children_;
  std::vector<std::string> old_failures_;  ///< what the failure file held when we began
  std::deque<std::size_t> waiting_;        ///< to be asked for
  std::deque<std::size_t> elsewhere_;      ///< others were at work there at our last look
  WallClock::time_point looked_ = WallClock::now();
};

}  // namespace

std::vector<RunStatus> findEarlierRuns(const std::vector<RunJob>& jobs, const std::string& program,
                                       bool repeat_failed) {
  const std::string stamp = programStamp(program);
  std::vector<RunStatus> statuses;
  for (const RunJob& job : jobs) {
    const EarlierRun earlier = findEarlierRun(job.directory, job.scenario, stamp);
    RunStatus status;
    status.note = earlier.note;
    if (earlier.state != EarlierRun::State::kNone && Claims::isClaimed(job.directory)) {
      status.note = "it did not get to its end";
      statuses.push_back(std::move(status));
      continue;
    }
    if (earlier.state == EarlierRun::State::kDone) status = {RunState::kDone, "", true, false};
    if (earlier.state == EarlierRun::State::kNotFinite) {
      if (repeat_failed) {
        status.note = "it failed";
      } else {
        status = {RunState::kFailed, earlier.note, true, false};
      }
    }
    statuses.push_back(std::move(status));
  }
  return statuses;
}

void makeRuns(const std::vector<RunJob>& jobs, const RunPoolOptions& options, std::vector<RunStatus>& statuses) {
  assert(statuses.size() == jobs.size());
  SharedJobs shared(jobs, options, statuses);
  while (true) {
    if (wantsStop(options)) return shared.stop();
    shared.update();
    if (shared.finished()) return;
    options.tick();
    std::this_thread::sleep_for(kPollInterval);
  }
}

}  // namespace brash_ice_rig
