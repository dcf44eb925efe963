#pragma once

#include <string>

namespace brash_ice_rig {

/// Tells on stderr how far long work has come: one line that is written anew in place on a terminal, otherwise one line
/// after another.
class ProgressLine {
 public:
  ProgressLine();

  bool onTerminal() const { return terminal_; }

  /// Replaces the line on a terminal, cut to its width; elsewhere prints a line.
  void show(const std::string& text);

  /// Prints a line that stays.
  void print(const std::string& text);

  /// Leaves the last line as it is and goes to the next.
  void end();

 private:
  bool terminal_;
  bool open_ = false;  ///< the cursor is behind text
};

/// `[######..................]  25 %  1:05 left`
/// @param done    share of the work, 0..1
/// @param left_s  time that the rest will take, s; < 0: not known, left out
std::string progressBar(double done, double left_s);

}  // namespace brash_ice_rig
