#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

namespace brash_ice_rig {

/// How a child process is to be started.
struct ChildSetup {
  std::string program;                 ///< path; no search, no shell
  std::vector<std::string> arguments;  ///< without the program's name
  std::string log_file;                ///< replaced; takes stdout and stderr. Empty: ours
  int standard_input = -1;             ///< an open descriptor; -1: ours
  bool own_group = false;              ///< a process group of its own: Ctrl-C in our terminal does not reach it
  /// Environment variables whose names begin so are not handed on.
  std::vector<std::string> hidden_variables;
};

/// How a child process ended.
struct ChildEnd {
  bool by_signal = false;
  int code = 0;  ///< exit code, or the signal's number

  bool success() const { return !by_signal && code == 0; }
  /// "exit code 2" or "ended by signal 9 (Killed)".
  std::string text() const;
};

/// A running program that we started. It does not outlive this object.
class ChildProcess {
 public:
  /// @throws std::system_error naming program or log file, if it cannot be started
  explicit ChildProcess(const ChildSetup& setup);
  /// Kills the child if it still runs.
  ~ChildProcess();
  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&&) = delete;

  pid_t id() const { return id_; }

  /// How it ended; empty while it runs.
  std::optional<ChildEnd> poll();

  /// Waits for its end.
  /// @param stop  asked now and then; when it says true, waiting ends early
  /// @return empty if the child still runs
  std::optional<ChildEnd> wait(std::chrono::milliseconds timeout, const std::function<bool()>& stop = {});

  /// Does nothing once poll() or wait() has seen the end.
  void sendSignal(int number);

 private:
  pid_t id_ = 0;
  std::optional<ChildEnd> end_;
};

/// Path of a program that lies beside the running one.
std::string programBesideThis(const std::string& name);

/// Has a program that lies beside the running one make the report of a directory. If it cannot, says so on stderr.
/// @param stop  see ChildProcess::wait()
/// @return whether it could
bool makeReport(const std::string& program, const std::string& directory, const std::function<bool()>& stop);

/// Cores that this process may use, at least 1.
int coreCount();

}  // namespace brash_ice_rig
