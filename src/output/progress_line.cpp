#include "brash_ice_rig/output/progress_line.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <sys/ioctl.h>
#include <unistd.h>

namespace brash_ice_rig {
namespace {

/// Columns of the terminal behind stderr; a line that wraps could not be written anew in place.
std::size_t terminalWidth() {
  winsize size{};
  constexpr std::size_t kUsual = 80;
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : kUsual;
}

}  // namespace

ProgressLine::ProgressLine() : terminal_(isatty(STDERR_FILENO) != 0) {}

void ProgressLine::show(const std::string& text) {
  if (!terminal_) {
    print(text);
    return;
  }
  std::fprintf(stderr, "\r%s\033[K", text.substr(0, terminalWidth() - 1).c_str());
  std::fflush(stderr);
  open_ = true;
}

void ProgressLine::print(const std::string& text) {
  std::fprintf(stderr, "%s%s\n", open_ ? "\r\033[K" : "", text.c_str());
  std::fflush(stderr);
  open_ = false;
}

void ProgressLine::end() {
  if (open_) std::fputs("\n", stderr);
  open_ = false;
}

std::string progressBar(double done, double left_s) {
  constexpr int kWidth = 24;
  const int filled = static_cast<int>(std::lround(std::clamp(done, 0.0, 1.0) * kWidth));
  char text[40];
  std::snprintf(text, sizeof text, "] %3.0f %%", 100.0 * done);
  std::string bar = "[" + std::string(filled, '#') + std::string(kWidth - filled, '.') + text;
  if (left_s < 0.0) return bar;
  const auto left = static_cast<long>(std::ceil(left_s));
  std::snprintf(text, sizeof text, "  %ld:%02ld left", left / 60, left % 60);
  return bar + text;
}

}  // namespace brash_ice_rig
