#include "brash_ice_rig/system/child_process.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <sched.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace brash_ice_rig {
namespace {

/// posix_spawn's file actions, freed with their owner.
class FileActions {
 public:
  FileActions() { posix_spawn_file_actions_init(&actions_); }
  ~FileActions() { posix_spawn_file_actions_destroy(&actions_); }
  FileActions(const FileActions&) = delete;
  FileActions& operator=(const FileActions&) = delete;

  /// The child's descriptor `to` becomes a copy of `from`.
  void copy(int from, int to) { posix_spawn_file_actions_adddup2(&actions_, from, to); }
  const posix_spawn_file_actions_t* get() const { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_;
};

/// A descriptor that is closed with its owner.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number() const { return number_; }

 private:
  int number_;
};

bool isHidden(const char* variable, const std::vector<std::string>& prefixes) {
  for (const std::string& prefix : prefixes) {
    if (std::strncmp(variable, prefix.c_str(), prefix.size()) == 0) return true;
  }
  return false;
}

}  // namespace

std::string ChildEnd::text() const {
  if (!by_signal) return "exit code " + std::to_string(code);
  return "ended by signal " + std::to_string(code) + " (" + strsignal(code) + ")";
}

ChildProcess::ChildProcess(const ChildSetup& setup) {
  FileActions actions;
  const Descriptor log(
      setup.log_file.empty() ? -1 : open(setup.log_file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (!setup.log_file.empty()) {
    if (log.number() < 0) throw std::system_error(errno, std::generic_category(), setup.log_file);
    actions.copy(log.number(), STDOUT_FILENO);
    actions.copy(log.number(), STDERR_FILENO);
  }
  if (setup.standard_input >= 0) actions.copy(setup.standard_input, STDIN_FILENO);

  std::string program = setup.program;
  std::vector<std::string> texts = setup.arguments;
  std::vector<char*> arguments = {program.data()};
  for (std::string& text : texts) arguments.push_back(text.data());
  arguments.push_back(nullptr);
  std::vector<char*> environment;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    if (!isHidden(*variable, setup.hidden_variables)) environment.push_back(*variable);
  }
  environment.push_back(nullptr);

  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  if (setup.own_group) {
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  }
  const int code = posix_spawn(&id_, program.c_str(), actions.get(), &attributes, arguments.data(), environment.data());
  posix_spawnattr_destroy(&attributes);
  if (code != 0) throw std::system_error(code, std::generic_category(), program);
}

ChildProcess::~ChildProcess() {
  if (id_ == 0 || poll()) return;
  kill(id_, SIGKILL);
  waitpid(id_, nullptr, 0);
}

ChildProcess::ChildProcess(ChildProcess&& other) noexcept
    : id_(std::exchange(other.id_, 0)), end_(std::exchange(other.end_, std::nullopt)) {}

std::optional<ChildEnd> ChildProcess::poll() {
  if (end_) return end_;
  int status = 0;
  const pid_t done = waitpid(id_, &status, WNOHANG);
  if (done == 0 || (done < 0 && errno == EINTR)) return std::nullopt;
  // A child that is not ours to wait for any more (SIGCHLD ignored) ended unseen.
  if (done < 0) status = 0xff00;
  end_.emplace();
  end_->by_signal = WIFSIGNALED(status);
  end_->code = end_->by_signal ? WTERMSIG(status) : WEXITSTATUS(status);
  return end_;
}

std::optional<ChildEnd> ChildProcess::wait(std::chrono::milliseconds timeout, const std::function<bool()>& stop) {
  const auto start = std::chrono::steady_clock::now();
  while (!poll() && std::chrono::steady_clock::now() - start < timeout && !(stop && stop())) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return poll();
}

void ChildProcess::sendSignal(int number) {
  if (!end_) kill(id_, number);
}

std::string programBesideThis(const std::string& name) {
  std::error_code error;
  return (std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / name).string();
}

bool makeReport(const std::string& program, const std::string& directory, const std::function<bool()>& stop) {
  constexpr std::chrono::minutes kTimeout{15};
  ChildSetup setup;
  setup.program = programBesideThis(program);
  setup.arguments = {directory};
  std::string reason;
  try {
    ChildProcess report(setup);
    const std::optional<ChildEnd> end = report.wait(kTimeout, stop);
    if (end && end->success()) return true;
    reason = setup.program + " " + directory + ": " + (end ? end->text() : "stopped before its end");
  } catch (const std::system_error& error) {
    reason = error.what();
  }
  std::fprintf(stderr, "no report: %s\n", reason.c_str());
  return false;
}

int coreCount() {
  cpu_set_t set;
  CPU_ZERO(&set);
  return sched_getaffinity(0, sizeof set, &set) == 0 ? std::max(1, CPU_COUNT(&set)) : 1;
}

}  // namespace brash_ice_rig
