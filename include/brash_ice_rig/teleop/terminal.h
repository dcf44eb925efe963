#pragma once

#include <string>
#include <vector>

namespace brash_ice_rig {

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

  /// Shows these lines in place of those shown before. What is too long is cut at the terminal's width.
  void show(const std::vector<std::string>& lines);
  /// In characters; 80 if the terminal does not say.
  int width() const;

 private:
  bool closed_ = false;
  std::size_t shown_ = 0;
};

/// The signal that asks the program to end, or 0.
int endingSignal();

}  // namespace brash_ice_rig
