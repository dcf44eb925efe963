#include "brash_ice_rig/teleop/terminal.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <system_error>

namespace brash_ice_rig {
namespace {

constexpr char kEnter[] = "\x1b[?1049h\x1b[?25l\x1b[?7l";  // another page, no cursor, no wrapping
constexpr char kLeave[] = "\x1b[?7h\x1b[?25h\x1b[?1049l";

termios modes_before{};
volatile std::sig_atomic_t ending_signal = 0;

/// Only what a signal handler may call.
void restoreModes() {
  tcsetattr(STDIN_FILENO, TCSADRAIN, &modes_before);
  const ssize_t written = write(STDOUT_FILENO, kLeave, sizeof kLeave - 1);
  static_cast<void>(written);  // the terminal may be gone
}

void noteSignal(int signal) {
  ending_signal = signal;
}

void restoreAndDie(int signal) {
  restoreModes();
  raise(signal);  // the handler was reset: this one kills
}

void handle(int signal, void (*handler)(int), int flags) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = flags;
  sigemptyset(&action.sa_mask);
  sigaction(signal, &action, nullptr);
}

void writeAll(const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t written = write(STDOUT_FILENO, text.data() + done, text.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return;
    done += static_cast<std::size_t>(written);
  }
}

}  // namespace

Terminal::Terminal() {
  if (tcgetattr(STDIN_FILENO, &modes_before) != 0 || isatty(STDOUT_FILENO) == 0) {
    throw std::system_error(errno, std::generic_category(), "standard input and output must be a terminal");
  }
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) handle(signal, noteSignal, 0);
  for (const int signal : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE}) {
    handle(signal, restoreAndDie, static_cast<int>(SA_RESETHAND) | SA_NODEFER);
  }
  termios modes = modes_before;
  modes.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  modes.c_cc[VMIN] = 0;
  modes.c_cc[VTIME] = 0;
  modes.c_cc[VSUSP] = _POSIX_VDISABLE;
  tcsetattr(STDIN_FILENO, TCSADRAIN, &modes);
  writeAll(kEnter);
}

Terminal::~Terminal() {
  restoreModes();
}

std::string Terminal::read(int timeout_ms) {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  if (poll(&input, 1, timeout_ms) <= 0) return "";
  char buffer[64];
  const ssize_t count = ::read(STDIN_FILENO, buffer, sizeof buffer);
  if (count > 0) return {buffer, static_cast<std::size_t>(count)};
  if (count == 0 || errno != EINTR) closed_ = true;
  return "";
}

void Terminal::show(const std::vector<std::string>& lines) {
  const std::size_t count = std::min(lines.size(), static_cast<std::size_t>(size().rows));
  std::string text = "\x1b[H";
  for (std::size_t i = 0; i < count; ++i) text += (i == 0 ? "" : "\r\n") + lines[i] + "\x1b[K";
  writeAll(text + "\x1b[J");
}

TerminalSize Terminal::size() const {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0) return {};
  return {size.ws_row, size.ws_col};
}

int endingSignal() {
  return ending_signal;
}

}  // namespace brash_ice_rig
