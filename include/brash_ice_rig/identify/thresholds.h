#pragma once

#include <string>
#include <utility>
#include <vector>

namespace brash_ice_rig {

/// What is asked of the evidence before an effect is named. Set on lifts of another program's making that are not
/// tests, or no longer: doc/identification.md tells which.
struct Thresholds {
  double log_bayes_factor = 6.0;           ///< that an effect must exceed, at least
  double chi2_per_bin = 1.27;              ///< above it, the refitted baseline's residual is significant
  double portmanteau_p = 0.001;            ///< below it, too
  double portmanteau_chi2_per_bin = 1.15;  ///< and chi² is above this
  double explained_ratio = 0.35;           ///< of the excess of chi², that an effect must explain
  double holdout_log_ratio = -1.0;         ///< ln of the held-out record's odds with the effect, to be exceeded
  double error_ratio = 2.0;                ///< of either record's error to that without the effect, not to be exceeded
  double rival_nats = 3.0;                 ///< evidence of both records this close tells no effects apart
  double rival_share = 0.25;               ///< or as close as this share of the better one's: no law is nature's
  double rival_correlation = 0.9;          ///< of what two effects do to the force; above it they are of one class
  double second_effect = 6.0;              ///< ln of the Bayes factor that a second effect must add
  double detectability = 5.0;  ///< d' at which a magnitude counts as detectable, and below which none is named
  int null_records = 0;        ///< no-effect records behind the effects' own thresholds
  /// The effects' own: the 97 % quantile of ln of the Bayes factor on those records, where it is above the common one.
  std::vector<std::pair<std::string, double>> own;

  double of(const std::string& effect) const {
    for (const auto& [name, value] : own) {
      if (name == effect && value > log_bayes_factor) return value;
    }
    return log_bayes_factor;
  }
};

Thresholds identificationThresholds();

}  // namespace brash_ice_rig
