#include "brash_ice_rig/study/run_pool.h"

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
#include "brash_ice_rig/study/run_directory.h"
#include "brash_ice_rig/system/child_process.h"

namespace brash_ice_rig {
namespace {

/// Long for a program that looks at its watch, short for people, nothing for the cores.
constexpr std::chrono::milliseconds kPollInterval{20};

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
  return {RunState::kFailed, why, false};
}

/// What became of a run, from how its child ended and what it left.
RunStatus outcome(const std::string& directory, const ChildEnd& end) {
  std::string status;
  try {
    status = valueOf(readSummary(directory), "status");
  } catch (const std::exception& error) {
    if (end.success()) return failed(error.what());
  }
  if (end.success()) return {RunState::kDone, "", false};
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
    // To the child it must look as if it had been started by hand.
    setup.hidden_variables = {"OMPI_", "PMIX_", "PRTE_", "PMI_"};
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

// ---- messages: a first word, then parts, one a line; the last part may have many lines

// From the others to rank 0.
constexpr const char* kRequest = "request";  // stamp of the program
constexpr const char* kResult = "result";    // job, 1 done or 0 failed, note
constexpr const char* kStopped = "stopped";  // asked from outside to end
// From rank 0.
constexpr const char* kRun = "run";  // job, directory, scenario

/// Cuts off the first line.
std::string takeLine(std::string& text) {
  const auto end = text.find('\n');
  std::string line = text.substr(0, end);
  text.erase(0, end == std::string::npos ? end : end + 1);
  return line;
}

/// Rank 0's view of the other processes.
class OtherProcesses {
 public:
  OtherProcesses(MessagePassing& messages, std::string stamp) : messages_(messages), stamp_(std::move(stamp)) {}

  bool hasRoom() const { return !idle_.empty(); }
  bool stopped() const { return stopped_; }

  void start(std::size_t job, const RunJob& run) {
    messages_.send(idle_.front(),
                   std::string(kRun) + "\n" + std::to_string(job) + "\n" + run.directory + "\n" + toYaml(run.scenario));
    idle_.pop_front();
  }

  /// Reads what has come; results since the last call.
  std::vector<Children::Result> collect() {
    std::vector<Children::Result> results;
    while (std::optional<MessagePassing::Message> message = messages_.receive()) {
      std::string& text = message->text;
      const std::string word = takeLine(text);
      if (word == kRequest) {
        if (text != stamp_) {
          throw std::runtime_error("process " + std::to_string(message->from) + " of MPI is another program: " + text);
        }
        idle_.push_back(message->from);
      } else if (word == kResult) {
        const std::size_t job = std::stoul(takeLine(text));
        const bool done = takeLine(text) == "1";
        results.push_back({job, done ? RunStatus{RunState::kDone, "", false} : failed(text)});
      } else if (word == kStopped) {
        stopped_ = true;
      }
    }
    return results;
  }

 private:
  MessagePassing& messages_;
  std::string stamp_;
  std::deque<int> idle_;  ///< one entry per run that a process could take
  bool stopped_ = false;
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
    if (earlier.state == EarlierRun::State::kDone) status = {RunState::kDone, "", true};
    if (earlier.state == EarlierRun::State::kNotFinite) {
      if (repeat_failed) {
        status.note = "it failed";
      } else {
        status = {RunState::kFailed, earlier.note, true};
      }
    }
    statuses.push_back(std::move(status));
  }
  return statuses;
}

void makeRuns(const std::vector<RunJob>& jobs, const RunPoolOptions& options, MessagePassing& messages,
              std::vector<RunStatus>& statuses) {
  assert(statuses.size() == jobs.size());
  Children children(options);
  OtherProcesses others(messages, children.stamp());
  std::deque<std::size_t> waiting;
  for (std::size_t job = 0; job < jobs.size(); ++job) {
    if (statuses[job].state == RunState::kWaiting) waiting.push_back(job);
  }
  std::size_t unfinished = waiting.size();
  const auto book = [&](const Children::Result& result) {
    statuses[result.job] = result.status;
    --unfinished;
    options.changed(result.job);
  };
  const auto takeNext = [&] {
    const std::size_t job = waiting.front();
    waiting.pop_front();
    statuses[job].state = RunState::kRunning;
    options.changed(job);
    return job;
  };
  while (unfinished > 0) {
    std::vector<Children::Result> results = children.collect();
    for (Children::Result& result : others.collect()) results.push_back(std::move(result));
    if (wantsStop(options) || others.stopped()) {
      // A Ctrl-C reaches the children, too: that they did not finish is no failure.
      for (const Children::Result& result : results) {
        if (result.status.state == RunState::kDone) book(result);
      }
      children.stop();
      for (RunStatus& status : statuses) {
        if (status.state == RunState::kRunning) status.state = RunState::kWaiting;
      }
      return;
    }
    for (const Children::Result& result : results) book(result);
    while (!waiting.empty() && children.hasRoom()) {
      const std::size_t job = takeNext();
      children.start(job, jobs[job].directory, toYaml(jobs[job].scenario));
    }
    while (!waiting.empty() && others.hasRoom()) {
      const std::size_t job = takeNext();
      others.start(job, jobs[job]);
    }
    options.tick();
    std::this_thread::sleep_for(kPollInterval);
  }
}

void serveRuns(const RunPoolOptions& options, MessagePassing& messages) {
  Children children(options);
  int requests = 0;  // without an answer yet, and runs that go on
  bool stopped = false;
  while (true) {
    while (std::optional<MessagePassing::Message> message = messages.receive()) {
      std::string& text = message->text;
      const std::string word = takeLine(text);
      if (word == MessagePassing::kStop) {
        children.stop();
        return;
      }
      if (word != kRun || stopped) continue;
      const std::size_t job = std::stoul(takeLine(text));
      const std::string directory = takeLine(text);
      children.start(job, directory, text);
    }
    const std::vector<Children::Result> results = children.collect();
    if (!stopped && wantsStop(options)) {
      stopped = true;
      messages.send(0, kStopped);
      children.stop();
    }
    for (const Children::Result& result : results) {
      if (stopped) break;
      const bool done = result.status.state == RunState::kDone;
      messages.send(0, std::string(kResult) + "\n" + std::to_string(result.job) + "\n" + (done ? "1" : "0") + "\n" +
                           result.status.note);
      --requests;
    }
    for (; !stopped && requests < options.children; ++requests) {
      messages.send(0, std::string(kRequest) + "\n" + children.stamp());
    }
    std::this_thread::sleep_for(kPollInterval);
  }
}

}  // namespace brash_ice_rig
