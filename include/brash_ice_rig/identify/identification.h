#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "brash_ice_rig/identify/candidate.h"
#include "brash_ice_rig/identify/covariance.h"
#include "brash_ice_rig/identify/curve_error.h"
#include "brash_ice_rig/identify/evidence.h"
#include "brash_ice_rig/identify/observation.h"
#include "brash_ice_rig/identify/record_check.h"
#include "brash_ice_rig/identify/run_library.h"
#include "brash_ice_rig/identify/thresholds.h"

namespace brash_ice_rig {

enum class Verdict { kNone, kEffect, kTie, kUnknown, kCannotTell };
const char* verdictName(Verdict verdict);

/// A parameter of the baseline that is refitted.
struct BaselineParameter {
  std::string key, unit;
  double prior = 0.0, prior_sigma = 1.0;
  double fitted = 0.0, sigma = 0.0;
};

/// One record with what was computed for it.
struct RecordCurves {
  std::string path;
  Record record;
  RecordReport report;
  Observation observation;
  bool procedure_known = false;                           ///< its references start, stop and turn where it does
  Eigen::VectorXd baseline_n, refitted_n, with_effect_n;  ///< in its bins; the last empty without a verdict
  Eigen::VectorXd total_sigma_n;                          ///< noise and discrepancy
  CurveError before, refitted, after;
};

/// One explanation: an effect, or two, in the shape that fits best.
struct Explanation {
  std::vector<std::string> effects;
  std::string shape;
  double log_bayes_factor = 0.0;
  double threshold = 0.0;
  double explained_ratio = 0.0;
  double chi2_per_bin = 0.0;
  double portmanteau_p = 0.0;
  double detectability = 0.0;  ///< d' of what was found
  bool confirmed = false;      ///< by simulation with the effect switched on
  double rmse_n = 0.0;
  double error_ratio = 0.0;     ///< error over that without the effect; with the lateral channels where they matter
  double holdout_rmse_n = 0.0;  ///< of the held-out record's vertical force; NaN without one
  double holdout_ratio = 0.0;  ///< error of the held-out record over that without the effect, all channels; NaN without
  /// ln of how much more probable the held-out record is with it than without; NaN without.
  double holdout_log_ratio = 0.0;
  /// The same if its swell kept its length along the hoist's way instead of its period, as what turns with a drum does.
  /// NaN without swell, or where both records go at the same speed.
  double holdout_way_log_ratio = 0.0;
  /// By which explanations are compared: ln of the Bayes factor that the fitted and the held-out record give together.
  /// The first says how large the effect is, the second how probable it makes a lift that it was not fitted to; of the
  /// first alone where that was not predicted. Less what its threshold exceeds the common one: so much of it lifts have
  /// that lack nothing.
  double evidence_of_both = 0.0;
  std::vector<ParameterEstimate> parameters;
  std::vector<double> baseline;  ///< fitted, in the order of Identification::baseline
  std::string note;
};

struct DetectableMagnitude {
  std::string effect, key, unit;
  double value = 0.0;  ///< at d' = Thresholds::detectability; NaN if arrangements of the blocks agree on nothing
  double expected_detectability = 0.0;  ///< of an effect as large as its prior expects, without their scatter
};

struct ConfusableSet {
  std::vector<std::string> effects;
  double correlation = 0.0;
  std::string how_to_tell;
};

struct NextExperiment {
  std::string text;
  std::vector<std::string> separates;
};

/// All that an identification found out.
struct Identification {
  Verdict verdict = Verdict::kCannotTell;
  std::vector<std::string> effects;  ///< best first; of a tie all that it is between
  std::vector<std::string> summary;  ///< sentences for people
  bool significant = false;
  double chi2_per_bin = 0.0, portmanteau_p = 1.0, kappa = 1.0;
  std::size_t bins = 0;
  std::vector<Explanation> ranking;     ///< the likeliest first
  std::optional<std::size_t> accepted;  ///< place in the ranking of the explanation that holds
  std::vector<BaselineParameter> baseline;
  std::vector<RecordCurves> records;  ///< those that were fitted
  std::vector<RecordCurves> holdout;  ///< one or none
  std::vector<DetectableMagnitude> minimum_detectable;
  std::vector<ConfusableSet> confusable;
  std::vector<NextExperiment> next_experiment;
  Eigen::VectorXd whitened_before;  ///< residual of the refitted baseline in units of what is allowed, bin by bin
  std::vector<double> autocorrelation_before, autocorrelation_after;
  Discrepancy discrepancy;  ///< as it was used
  double ice_factor = 1.0;  ///< of its variance, for ice unlike that of the references: see computeIceFactor()
  std::string overlay;      ///< YAML of baseline and effect; empty if there is nothing to change
  std::size_t runs_needed = 0, runs_made = 0;
  double wall_s = 0.0;
};

struct NamedRecord {
  std::string path;  ///< as the user calls it
  Record record;
};

struct IdentifyInput {
  std::vector<NamedRecord> records;    ///< at least one; fitted together
  std::optional<NamedRecord> holdout;  ///< must be predicted
  std::vector<NamedRecord>
      references;            ///< lifts of this rig without an effect: they teach how far the simulator is off
  bool screen_only = false;  ///< rank by straight lines and confirm nothing: a quick look
};

/// The whole chain from records to a verdict.
/// @throws ConfigError if a record cannot be used; Interrupted
Identification identify(const IdentifyInput& input, RunLibrary& runs, const Thresholds& thresholds,
                        const Discrepancy& discrepancy);

/// report.json; the schema is in doc/identification.md.
std::string toJson(const Identification& identification, const Thresholds& thresholds);

struct IdentifyOptions {
  IdentifyInput input;
  std::string directory;            ///< for the results
  std::string cache;                ///< for the runs; empty: directory/runs
  int children = 0;                 ///< runs at a time; 0: one per core, under mpirun one in each process
  bool shared = false;              ///< other processes may make the same identification; under mpirun always
  double lease_s = kDefaultLeaseS;  ///< see RunPoolOptions
  std::string simulator;            ///< brash_ice that makes the runs; empty: the running one
  bool report = true;               ///< make report.html in the end
  std::function<bool()> stop;       ///< says true when all is to end
};

/// Identifies and leaves report.json, overlay.yaml, report.html. Processes that share an identification all call this:
/// each computes all of it but for the runs, of which each makes some, and the first that is ready writes the files.
/// @return false after an interruption
bool runIdentify(const IdentifyOptions& options);

}  // namespace brash_ice_rig
