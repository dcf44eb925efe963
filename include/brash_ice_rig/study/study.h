#pragma once

#include <functional>
#include <string>

#include "brash_ice_rig/study/run_pool.h"

namespace brash_ice_rig {

struct StudyOptions {
  std::string file;                 ///< study YAML
  std::string directory;            ///< for the results; resumed if it holds some
  int children = 0;                 ///< runs at a time; 0: as many as the cores carry, one in each process under mpirun
  bool shared = false;              ///< other processes may make runs of the same study; under mpirun always
  double lease_s = kDefaultLeaseS;  ///< see RunPoolOptions
  bool report = true;               ///< make report.html in the end
  bool repeat_failed = false;       ///< make runs again whose world froze
  std::function<bool()> stop;       ///< says true when all is to end
};

/// Makes the runs of a study that are not done yet, then results.csv and report.html; doc/studies.md tells the files.
/// Processes that share a study all call this; the first that finds all runs done writes the table. Progress goes to
/// stderr, paths to stdout.
/// @return whether all runs are done and none has failed; of a process that leaves the table to another: true
/// @throws ConfigError if the study file is wrong, before anything is touched
/// @throws OutputError, std::runtime_error if the study cannot go on
bool runStudy(const StudyOptions& options);

}  // namespace brash_ice_rig
