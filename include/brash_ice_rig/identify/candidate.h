#pragma once

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "brash_ice_rig/effects/effect_registry.h"
#include "brash_ice_rig/identify/observation.h"

namespace brash_ice_rig {

/// One unknown of an effect: the force is linear in it as long as it is small.
struct Amplitude {
  std::string name;   ///< of the parameter
  double step = 1.0;  ///< value at which the effect is simulated to see what it does
  double prior_mean = 0.0, prior_sigma = 1.0;
  bool positive = false;
  /// That can be simulated. Below zero although its parameter is a size: the other way, or the other phase.
  double least = -std::numeric_limits<double>::infinity(), most = std::numeric_limits<double>::infinity();
  /// Of a swing, with the other amplitudes of this number: in another lift it has another phase. 0: of none.
  int swing = 0;
  bool once = false;  ///< of an event that another lift need not have
};

/// A parameter as it is told in the end, with its 95 % interval.
struct ParameterEstimate {
  std::string key, unit;
  double value = 0.0, low = 0.0, high = 0.0;
  double prior_low = 0.0, prior_high = 0.0;
};

/// An effect with its shape decided, and what is left to be found.
struct Variant {
  const EffectDescription* effect = nullptr;
  std::string label;  ///< tells the variants of an effect apart
  std::vector<Amplitude> amplitudes;
  std::vector<double> periods_s;  ///< of swell; none of another effect
  /// Straight lines say nothing of what it does before the lift: that counts where it is simulated.
  bool hangs_clear = false;
  /// Of a leaning pole: what each amplitude does to the lateral force in its direction, N per unit, a row per bin.
  Eigen::MatrixXd lateral_n;
  /// Values of the effect's parameters for given amplitudes, the effect switched on.
  std::function<void(EffectValues&, const Eigen::VectorXd&)> apply;
  /// Estimates of all its parameters that a record can tell.
  std::function<std::vector<ParameterEstimate>(const Eigen::VectorXd& amplitudes, const Eigen::MatrixXd& covariance)>
      estimate;
};

/// The ways in which an effect is tried without a look at the record: amplitudes as the registry has them, the shape
/// parameter that is `tried` at its prior's median and one deviation above and below, three values of a `seed`, all
/// others at their defaults. block_drop and vessel_heave, whose times and periods are anywhere, have none: see
/// Chain::locate().
/// @param position  of the record: a measured one has the loss of hoist speed in it already
std::vector<Variant> makeVariants(const EffectDescription& effect, PositionOrigin position);

/// block_drop with falls at given times, s, at most 3, each within 1 s.
Variant makeFalls(const std::vector<double>& times_s);

/// vessel_heave with given periods, s, at most 3. Two amplitudes per period: of sine and cosine.
/// @param hangs_clear  of the ice before the lift. A rig that knocks at it does so in proportion to the swell, roughly
Variant makeSwell(const std::vector<double>& periods_s, bool hangs_clear);

/// pole_tilt whose top moves along, where lateral channels show a direction: drift, and sway of the usual period. The
/// channels do not show its way. Amplitudes have both signs.
/// @param direction_deg  in (-180, 180]
std::vector<Variant> makeUprightTilts(double direction_deg);

/// The ways that a leaning pole may go, with what lateral channels show of each: drift, sway of four periods as sine
/// and cosine, and drift with each of the two longer ones. Amplitudes have both signs. They are simulated at the size
/// that fits the way best, but no less than the prior's sigma.
/// @param direction_deg  in (-180, 180]
/// @param pole_length_m  > 0
/// @param time_s         of bins, 0 at the start of the lift
/// @param tension_n      in the bins, the rig's weight included
/// @param along_n        lateral force in the direction
std::vector<Variant> makeLeaningTilts(double direction_deg, double pole_length_m, const Eigen::VectorXd& time_s,
                                      const Eigen::VectorXd& tension_n, const Eigen::VectorXd& along_n);

/// What a fall of 1 kg of ice takes off the force, N, roughly: for finding its time only.
Eigen::VectorXd fallTemplate(double time_s, const Eigen::VectorXd& bin_time_s);

/// What 1 m of heave as sine and as cosine does to the force, N, one column each, from what swell of another period was
/// simulated to do: ice and net answer within a time that is short against both. For finding its period only.
/// @param simulated  a row per bin, sine and cosine  @param time_s  of the bins, from where both have phase 0
/// @param mass_kg    of rig and ice in the bins, whose inertia grows with the square of the pitch
Eigen::MatrixXd swellResponse(const Eigen::MatrixXd& simulated, double simulated_period_s, double period_s,
                              const Eigen::VectorXd& time_s, const Eigen::VectorXd& mass_kg);

/// Lets an effect of the load cell act on a force that is not zero where the empty rig hangs in the water.
/// @param values  of an effect that is reading_only, enabled
SimulatedForce throughLoadCell(const EffectValues& values, const Scenario& scenario, const SimulatedForce& force);

}  // namespace brash_ice_rig
