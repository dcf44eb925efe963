#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario.h"

namespace brash_ice_rig {

/// One variant of the scenario, to be run once per seed.
struct StudyCase {
  std::string name;   ///< of its directory, too: letters, digits and . _ - = , only
  std::string title;  ///< for legends
  /// Keys that the study itself sets, those for all cases included, with their values as written. What overlays change
  /// is not among them.
  std::vector<std::pair<std::string, std::string>> settings;
};

/// A figure of the report.
struct StudyFigure {
  std::string kind;  ///< hardening, force, bars, snapshots or plug
  std::string title;
  std::vector<std::string> cases;  ///< names, at least one; of snapshots exactly one
  std::vector<double> times_s;     ///< of snapshots only
};

/// One run of the program.
struct StudyRun {
  std::size_t case_index = 0;
  std::uint64_t seed = 0;  ///< field.seed
  Scenario scenario;       ///< effective and valid
};

/// A study: many runs of one scenario and what is to be drawn of them.
struct Study {
  std::string title;
  std::string scenario_file;  ///< its name without directories
  std::vector<std::uint64_t> seeds;
  std::vector<StudyCase> cases;
  std::vector<StudyFigure> figures;
  std::string findings;        ///< paper, or empty
  std::vector<StudyRun> runs;  ///< every case with every seed, in the order of cases, then seeds
};

/// Whether a file is a study: it has one of the keys cases, grid and sample. False if it cannot be read.
bool isStudyFile(const std::string& path);

/// Reads a study file, doc/studies.md, and builds and checks the effective scenario of every run.
/// @throws ConfigError naming file, line, key, value and rule
Study readStudy(const std::string& path);

/// Where a run's files lie, relative to the study's directory: runs/CASE/seed_N.
std::string runDirectory(const Study& study, const StudyRun& run);

/// The study without its runs, as study.yaml holds it: with figures and titles that the file left to their defaults.
std::string toYaml(const Study& study);

}  // namespace brash_ice_rig
