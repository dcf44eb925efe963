#pragma once

#include <array>
#include <string>
#include <vector>

#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/material/cap_kernels.h"
#include "brash_ice_rig/material/damage.h"
#include "brash_ice_rig/material/material.h"

namespace brash_ice_rig {

/// Parameters of the continuous surface cap model. Symbols and equation numbers are those of the paper.
struct CapParameters {
  double alpha_pa = 0.0;              ///< alpha of eq. 7, Pa, > 0
  double theta = 0.0;                 ///< theta of eq. 7, no unit, > 0
  double aspect_ratio = 0.0;          ///< R, ratio of the axes of the cap, > 0
  double initial_intercept_pa = 0.0;  ///< X0 of eq. 12, Pa, > 0
  double max_compaction = 0.0;        ///< W of eq. 12, ratio, in (0, 1)
  double d1_per_pa = 0.0;             ///< D1 of eq. 12, 1/Pa, > 0
  double d2_per_pa2 = 0.0;            ///< D2 of eq. 12, 1/Pa², ≥ 0
  double bulk_modulus_pa = 0.0;       ///< K of eq. 6, Pa, > 0
  double shear_modulus_pa = 0.0;      ///< G of eq. 6, Pa, > 0
  double stiffness_scale = 1.0;       ///< these moduli over the ice's own, > 0
  FlowRule flow_rule = FlowRule::kAssociated;
  bool three_invariant = false;  ///< strength depends on the Lode angle (eq. 11)
  bool gap_memory = false;       ///< an opened gap must close before pressure returns
  bool damages = false;          ///< stress degrades by `damage`
  DamageParameters damage;
};

/// Cap parameters of a brash ice: eqs. 5 and 6 for the moduli, eq. 10 for the shear surface where the configuration
/// gives none, eqs. 13 to 15 for the fracture energies.
/// @param ice               a validated configuration
/// @param stiffness_scale   factor on the elastic modulus alone, > 0; strength, hardening and fracture energy stay
/// @param element_length_m  cube root of a particle's volume, m, > 0
CapParameters makeCapParameters(const IceConfig& ice, double stiffness_scale, double element_length_m);

/// Makes the ice stronger or weaker: its whole yield surface grows with the ratio, and its fracture energies with the
/// ratio squared, as ScaledStrength does it for a particle. Cohesion alone, with the fracture energies of Table 7 for
/// all, makes strong ice so brittle that it lifts no more than weak ice does.
/// @param ice    a validated configuration; its cap_max_compaction stays in its range
/// @param ratio  of new strength to old, > 0
void scaleStrength(IceConfig& ice, double ratio);

/// Continuous surface cap model (CSCM): a Drucker-Prager cone and a cap that moves with plastic volume change, as one
/// smooth yield surface (eqs. 7-9)
///   f = J2' - Q² F_f(J1)² F_c(J1, e),   F_f = alpha + theta J1,   F_c = 1 - t² for t > 0 and 1 below,
/// with J1 = -tr(stress) > 0 in compression, t = (J1 - L) / (X - L), cap intercept X(e) from eq. 12 and cap start L
/// from X - L = R F_f(L). Q is Rubin's factor of the Lode angle, 1 unless three_invariant is set.
///
/// Flow. Associated: normal to f at constant Lode angle. Non-associated: in the volumetric part F_f is held constant,
/// so that the cone keeps its volume and the cap compacts; only the apex of the cone opens.
///
/// State: "compaction" is the plastic volume strain e, ratio, > 0 in compaction; it moves the cap. Dilation brings the
/// cap back no further than X0, there e stays 0. "plastic_strain" is the accumulated deviatoric plastic strain,
/// ratio, sum of sqrt(2/3 de:de), which is the axial strain in a constant-volume uniaxial test.
///
/// Damage (Murray 2007). The surface above holds for the undamaged stress; the stress is (1 - d) of it. Ductile damage
/// grows while the mean stress is compressive, with tau_c = sqrt(stress : strain / 2); brittle damage while it is
/// tensile, with tau_t = sqrt(E) times the largest principal strain, stress undamaged and strain total. The elastic
/// part of that strain, and E, are those of the ice's own modulus: what scaling it down adds in strain breaks nothing.
/// Each starts where flow without compaction is first met. Neither heals, but brittle damage has no part in
/// compression: a crack that closes carries pressure. (1 - d) of a frictional stress takes away cohesion and stiffness,
/// not friction. State: "damage" is d as applied now; "brittle_damage", "ductile_damage"; their thresholds, sqrt(Pa), 0
/// before they are met; the total strain.
///
/// Gap memory: plastic opening under tension is kept in the state "gap", volume strain, ≥ 0. While it is open, closing
/// takes away gap instead of raising pressure, and brittle damage stays applied.
///
/// Eq. 12 asks for an infinite pressure as e nears W. Beyond e = 0.9999 W (109 kPa for set 1 of Table 6) its tangent
/// goes on, so that each pressure has a finite cap.
///
/// A particle with NaN in stress, strain increment or compaction gets NaN stress and keeps its state. Finite input
/// gives finite output; a result beyond the range of float is clamped to it.
///
/// Sources: paper eqs. 7-12; Schwer and Murray (1994); Murray (2007), FHWA-HRT-05-062.
class CapModel : public Material {
 public:
  /// Parameters outside their ranges are a bug of the caller (assert).
  /// @param set  for which the kernels are compiled that update() uses; an available one
  explicit CapModel(const CapParameters& parameters, InstructionSet set = chosenInstructionSet());

  std::vector<std::string> stateNames() const override { return state_names_; }
  std::size_t stateTensors() const override { return parameters_.damages ? 1 : 0; }
  /// In lanes of several particles (cap_kernels.h); those that this leaves go one by one.
  void update(MaterialBatch& batch) const override;
  /// The same to the resolution of float, one particle after the other: what the kernels are tested against.
  void updateOneByOne(MaterialBatch& batch) const;
  double bulkModulus() const override { return parameters_.bulk_modulus_pa; }
  double shearModulus() const override { return parameters_.shear_modulus_pa; }
  double elasticEnergyDensity(const std::array<float, kComponents>& stress_pa,
                              const std::vector<float>& state) const override;
  const CapParameters& parameters() const { return parameters_; }

  /// Cap intercept X, Pa, ≥ X0: eq. 12 solved for X.
  /// @param compaction  e, ratio; X0 for e ≤ 0
  double capIntercept(double compaction) const { return capAt(compaction).intercept; }

  /// Cap start L, Pa: the largest J1 that the cap leaves untouched.
  /// @param compaction  e, ratio
  double capStart(double compaction) const { return capAt(compaction).start; }

  /// sqrt(J2') on the yield surface in triaxial compression, without damage, Pa; 0 beyond apex and cap.
  /// @param j1_pa       -tr(stress), Pa
  /// @param compaction  e, ratio
  double shearStrength(double j1_pa, double compaction) const;

 private:
  struct Cap {
    double intercept;  // X, Pa
    double start;      // L, Pa
    double width;      // X - L, Pa
    double hardening;  // dX/de, Pa; 0 where the cap is floored at X0
  };
  struct Invariants {
    double j1;  // Pa
    double s;   // sqrt(J2'), Pa
  };
  struct Returned {
    Invariants stress;
    double increment;  // plastic compaction of this step
  };
  struct Residual {
    double value, slope, tolerance;  // value < 0 outside the surface; slope by the increment
    Invariants stress;
  };

  Cap capWithIntercept(double intercept, double hardening) const;
  Cap capAt(double compaction) const;
  bool isElastic(const Invariants& trial, double compaction, const Cap& cap) const;
  Residual computeResidual(double increment, const Cap& cap, const Invariants& trial, double shear) const;
  Returned returnToSurface(const Invariants& trial, double shear, double compaction, const Cap& cap) const;
  double degradeStress(const MaterialBatch& batch, std::size_t i, const double* undamaged, const Invariants& invariants,
                       bool shears) const;
  CapConstants makeConstants() const;
  void updateParticle(const MaterialBatch& batch, std::size_t i) const;

  CapParameters parameters_;
  Softening softening_;
  const CapKernels* kernels_;
  CapConstants constants_;
  std::vector<std::string> state_names_;
  // Where a state is among them, if it is.
  std::size_t gap_ = 0, damage_ = 0;
  // Constants of the surface. The cap keeps its shape as it moves: X - L is proportional to X + alpha / theta, and
  // the neutral point, where flow neither compacts nor dilates, sits at one t.
  double apex_;           // alpha / theta, Pa: the cone ends at J1 = -apex
  double root_elastic_;   // sqrt(E) of the ice's own modulus, sqrt(Pa)
  double width_ratio_;    // (X - L) / (X + apex)
  double neutral_;        // t of the neutral point
  double tangent_onset_;  // e at which the tangent replaces eq. 12
  Cap virgin_, onset_;    // at e = 0 and at the tangent's onset
};

}  // namespace brash_ice_rig
