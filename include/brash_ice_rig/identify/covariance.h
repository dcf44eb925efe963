#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/identify/observation.h"

namespace brash_ice_rig {

/// Unknowns of the ice: void fraction, cohesion (Pa), friction angle (degrees).
using IceValues = Eigen::Vector3d;

/// What the hoist does from one start, stop or turn to the next.
struct HoistStage {
  double start_s, duration_s, start_m, end_m;
};

/// The stages of a path but a rest at its end.
std::vector<HoistStage> stagesOf(const HoistPath& path);

/// Whether both start, stop and turn at the same ways, within 4 cm, and move the same way in between. How long they
/// rest, and where the last stage ends, may differ.
bool isSameProcedure(const std::vector<HoistStage>& a, const std::vector<HoistStage>& b);

/// How far the simulator may be from nature where nothing is missing. Amplitudes are shares of the force that the ice
/// exerts there, or of the largest one that is simulated; lengths are distances that the hoist covers.
struct Discrepancy {
  /// What reference lifts showed, over the way as unrollWay() has it, in shares of the force's level; empty without
  /// references. Their mean; the curves along which they differ among each other, each as large as its standard
  /// deviation; and what a further lift is off beside both. As many places each, the way increasing. They take the
  /// place of `share`.
  std::vector<double> way_m, mean_share, sigma_share;
  std::vector<std::vector<double>> modes_share;
  std::vector<double> turn_way_m;     ///< where references start, stop or turn, so that they show what that does
  std::vector<HoistStage> procedure;  ///< of all references, in their shortest durations; empty if procedures differ
  std::vector<IceValues> ice;         ///< of the references, as fitted
  /// How far they are off before the first motion, in the same shares; takes the place of `rest_share`.
  std::optional<double> known_rest_share;
  bool fromReferences() const { return !way_m.empty(); }

  double share = 0.10;          ///< of the ice's force at the same place
  double share_of_peak = 0.02;  ///< of the largest force, everywhere during the motion
  double length_m = 0.3;        ///< over which it changes
  double rough_share = 0.04;    ///< of the ice's force: blocks that rearrange
  double rough_length_m = 0.03;
  double turn_share = 0.12;        ///< of the largest force, where the hoist starts, stops or turns
  double turn_length_m = 0.15;     ///< over which that fades
  double known_turn_share = 0.08;  ///< of the largest force, at a turn that references have, too
  double known_turn_length_m = 0.08;
  double rest_share = 0.01;       ///< of the largest force: how the rig touches the ice before the first motion
  double rest_length_m = 0.05;    ///< over which that is forgotten
  double form_share = 0.3;        ///< of what an effect does: laws differ
  double form_length_m = 0.3;     ///< over which that changes
  double timing_length_m = 0.05;  ///< over which it changes by how much an effect comes early or late
  double creep_mps = 0.002;  ///< ice at rest changes as if the hoist covered this, beside the places of known rests
};

/// Matérn's correlation of smoothness 3/2 (Rasmussen and Williams 2006, eq. 4.17): (1 + √3 d/l) exp(−√3 d/l).
/// @param distance  >= 0  @param length  > 0
double computeMatern32(double distance, double length);

/// Noise of the bins, N²: white, plus exponentials of 0.5, 4 and 30 s in equal parts, which together fall like 1/f in
/// between.
Eigen::MatrixXd computeNoiseCovariance(const ForceNoise& noise, const Eigen::VectorXd& time_s);

/// Largest mean over 8 s of a force in bins, N, or the mean of all where there is less: the level to which shares of
/// references refer. Swell and single blocks leave it as it is.
double computeLevel(const Eigen::VectorXd& force_n);

/// The way, going on where the hoist rests or goes down: each stage of the references' procedure has places of its own.
/// A rest goes on with the logarithm of its time, as far as references rest. A record of another procedure has the
/// places at which theirs comes by its way for the first time.
/// @param procedure  of the references; without any all goes with the way
/// @param time_s     since the start of the motion  @param way_m  of the collector since then, as many
Eigen::VectorXd unrollWay(const std::vector<HoistStage>& procedure, const HoistPath& path,
                          const Eigen::VectorXd& time_s, const Eigen::VectorXd& way_m);

/// What references showed the simulator to be off, as shares of its level: zero without them and before the motion.
/// @param path    of the hoist
/// @param time_s  since the start of the motion  @param way_m  of the collector since then, as many
Eigen::VectorXd computeKnownShare(const Discrepancy& discrepancy, const HoistPath& path, const Eigen::VectorXd& time_s,
                                  const Eigen::VectorXd& way_m);

/// A simulated force with what the simulator is known to be off. It goes with the way of the collector: where that
/// comes later than the hoist, so does all that happens to the ice.
SimulatedForce correctKnownDiscrepancy(const Discrepancy& discrepancy, const HoistPath& path, SimulatedForce force);

/// How much larger the variance of what the simulator is off must be taken for ice unlike that of the references: that
/// of a prediction by straight lines through them, 1 + xᵀ (XᵀX)⁻¹ x (Draper and Smith 1998, Applied Regression
/// Analysis), with one lift at one standard deviation in each direction added to them. 1 without references and at
/// their mean.
/// @param sigma  of what is believed of the ice, the unit of the distance; > 0
double computeIceFactor(const Discrepancy& discrepancy, const IceValues& ice, const IceValues& sigma);

/// A lift that lacks nothing, as far as the discrepancy can be learned from it.
struct ReferenceLift {
  HoistPath path;
  std::vector<double> time_s, way_m;   ///< of each bin since the motion began
  std::vector<double> residual_share;  ///< record less refitted baseline, over the level of the latter; as many
  std::optional<double> rest_share;    ///< mean of the residual before the motion over the level, where there is any
  IceValues ice = IceValues::Zero();   ///< of the refitted baseline
};

/// What lifts without an effect teach: mean, up to eight modes of their scatter (principal components, one for every
/// three lifts), and, lift by lift left out, what the others do not predict of it: its size over the way, the length
/// over which it changes, and its rough part; and how far the force at rest is off. One lift teaches its mean only.
/// @param lifts   at least one
/// @param before  whose other terms are kept
Discrepancy learnDiscrepancy(const std::vector<ReferenceLift>& lifts, const Discrepancy& before);

/// Ways at which the hoist starts, stops or turns, m.
std::vector<double> findTurns(const HoistPath& path);

/// Covariance of what an effect's law may be off, N²: nature's drainage is not the library's, and what happens at a
/// moment comes earlier or later there.
/// @param change_n        what the effect does to the force
/// @param timing_sigma_s  see EffectDescription; >= 0. Without references it does not count
Eigen::MatrixXd computeFormCovariance(const Discrepancy& discrepancy, const Observation& observation,
                                      const Eigen::VectorXd& change_n, double timing_sigma_s);

/// Covariance of what the simulator is off, N².
/// @param ice_force_n  of the simulation, in the bins of the observation
/// @param chaos_n      standard deviation between arrangements of the blocks, as many; counted beside `share`
Eigen::MatrixXd computeDiscrepancyCovariance(const Discrepancy& discrepancy, const Observation& observation,
                                             const Eigen::VectorXd& ice_force_n, const Eigen::VectorXd& chaos_n);

}  // namespace brash_ice_rig
