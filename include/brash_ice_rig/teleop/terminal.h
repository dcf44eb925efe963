#pragma once

#include <string>
#include <vector>

namespace brash_ice_rig {

/// In characters; as here if the terminal does not say.
struct TerminalSize {
  int rows = 24, columns = 80;
};

/// Takes single keys from the terminal, without echo and without waiting for the end of a line, while it lives. The
/// terminal gets its modes back when this ends, also by an exception, and after SIGABRT, SIGSEGV, SIGBUS and SIGFPE.
/// SIGINT, SIGTERM, SIGHUP and SIGQUIT are noted in endingSignal(), so that the program may end in order; suspending
/// (Ctrl-Z) is off. One at a time.
class Terminal {
 public:
  /// @throws std::system_error if standard input or output is no terminal
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  /// Waits for keys, at most this long. @return the bytes that have come; empty: none
  std::string read(int timeout_ms);
  /// The terminal is gone: no key will come any more.
  bool closed() const { return closed_; }

  /// Shows these lines in place of those shown before, on a page of their own that vanishes at the end. What does not
  /// fit is cut off at the right and at the bottom.
  void show(const std::vector<std::string>& lines);
  TerminalSize size() const;

 private:
  bool closed_ = false;
};

/// The signal that asks the program to end, or 0.
int endingSignal();

}  // namespace brash_ice_rig
