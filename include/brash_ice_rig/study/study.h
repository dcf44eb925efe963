#pragma once

#include <functional>
#include <string>

namespace brash_ice_rig {

struct StudyOptions {
  std::string file;            ///< study YAML
  std::string directory;       ///< for the results; resumed if it holds some
  int children = 0;            ///< runs at a time, per process of MPI; 0: as many as the cores carry, with MPI one
  bool report = true;          ///< make report.html in the end
  bool repeat_failed = false;  ///< make runs again whose world froze
  std::function<bool()> stop;  ///< says true when all is to end
};

/// Makes the runs of a study that are not done yet, then results.csv and report.html; doc/studies.md tells the files.
/// Under mpirun every process calls this; the first leads. Progress goes to stderr, paths to stdout.
/// @return whether all runs are done and none has failed
/// @throws ConfigError if the study file is wrong, before anything is touched
/// @throws OutputError, std::runtime_error if the study cannot go on
bool runStudy(const StudyOptions& options);

}  // namespace brash_ice_rig
