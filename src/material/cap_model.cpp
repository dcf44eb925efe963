#include "brash_ice_rig/material/cap_model.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include "brash_ice_rig/ice/ice_scaling.h"
#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {

// One table of kernels per instruction set: src/material/cap_kernels.cpp.
extern const CapKernels kCapKernels_baseline;
#ifdef BRASH_ICE_X86_KERNELS
extern const CapKernels kCapKernels_avx2;
extern const CapKernels kCapKernels_avx512;
#endif

const CapKernels& capKernels(InstructionSet set) {
#ifdef BRASH_ICE_X86_KERNELS
  if (set == InstructionSet::kAvx512) return kCapKernels_avx512;
  if (set == InstructionSet::kAvx2) return kCapKernels_avx2;
#endif
  assert(set == InstructionSet::kBaseline);
  return kCapKernels_baseline;
}

namespace {

constexpr double kTangentOnset = 1.0 - 1e-4;   // of W
constexpr int kMaxIterations = 300;            // more than halving takes any bracket of doubles to its tolerance
constexpr double kSmallestLodeFactor = 0.499;  // lower bound of lodeFactor(), whose minimum is 0.4995

float toFloat(double value) {
  constexpr double kLargest = std::numeric_limits<float>::max();
  return static_cast<float>(value > kLargest ? kLargest : value < -kLargest ? -kLargest : value);  // NaN passes
}

/// Strength at a Lode angle over strength in triaxial compression (Rubin 1991 in the form of Murray 2007), with
/// Q1 in torsion and Q2 in triaxial extension. Its square root runs over a conic through the three points; eq. 11
/// makes Q1 and Q2 independent of pressure.
/// @param sin_3_beta  1 in triaxial compression, 0 in torsion, -1 in triaxial extension
double lodeFactor(double sin_3_beta) {
  constexpr double kTorsion = 0.7373 - 0.17;  // Q1 = alpha_1 - lambda_1
  constexpr double kExtension = 0.66 - 0.16;  // Q2 = alpha_2 - lambda_2
  static const double a = [] {
    const double linear = std::sqrt(3.0) * kExtension + 2.0 * kTorsion * (kExtension - 1.0);
    const double constant = 2.0 * kTorsion * kTorsion * (kExtension - 1.0);
    return (std::sqrt(linear * linear - 4.0 * kExtension * constant) - linear) / (2.0 * kExtension);
  }();
  static const double b = (2.0 * kTorsion + a) * (2.0 * kTorsion + a) - 3.0;
  const double beta = repeatable::asin(std::clamp(sin_3_beta, -1.0, 1.0)) / 3.0;
  const double sine = repeatable::sin(beta);
  const double skewed = repeatable::cos(beta) - a * sine;
  const double quadratic = skewed * skewed + b * sine * sine;
  const double linear = a * skewed;
  const double constant = -0.25 * (3.0 + b - a * a);
  return (std::sqrt(linear * linear - 4.0 * quadratic * constant) - linear) / (2.0 * quadratic);
}

/// Largest eigenvalue of a symmetric tensor.
double largestPrincipal(const double* c) {
  Eigen::Matrix3d tensor;
  tensor << c[0], c[3], c[5], c[3], c[1], c[4], c[5], c[4], c[2];
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  // Not computeDirect(), which calls the C library's cosine.
  solver.compute(tensor, Eigen::EigenvaluesOnly);
  return solver.eigenvalues()[2];
}

/// Damage grows, but not by what float cannot resolve, or rest would creep.
void raise(float& damage, double value) {
  if (value > static_cast<double>(damage) + kDamageResolution) damage = toFloat(value);
}

}  // namespace

void scaleStrength(IceConfig& ice, double ratio) {
  assert(ratio > 0.0);
  constexpr double kLargestCompaction = 0.9;  // that a scenario allows
  ice.cohesion_pa *= ratio;
  if (ice.shear_constant_pa) *ice.shear_constant_pa *= ratio;
  ice.cap_initial_intercept_pa *= ratio;
  ice.cap_max_compaction = std::min(ice.cap_max_compaction * ratio, kLargestCompaction);
  ice.cap_hardening_linear_per_pa /= ratio;
  ice.cap_hardening_quadratic_per_pa2 /= ratio * ratio;
  ice.parent_fracture_energy_compression_jpm2 *= ratio * ratio;
  ice.parent_fracture_toughness_pa_sqrt_m *= ratio;
}

CapParameters makeCapParameters(const IceConfig& ice, double stiffness_scale, double element_length_m) {
  assert(stiffness_scale > 0.0 && element_length_m > 0.0);
  const double elastic_modulus = computeBrashElasticModulus(ice.parent_elastic_modulus_pa, ice.void_fraction);
  const ElasticModuli moduli = computeElasticModuli(stiffness_scale * elastic_modulus, ice.poisson_ratio);
  const ShearSurface surface = computeShearSurface(ice.cohesion_pa, ice.friction_angle_deg);
  CapParameters result;
  // Ranges that are open at 0 admit values so small that their products vanish.
  constexpr double kLeast = 1e-30;
  result.alpha_pa = std::max(ice.shear_constant_pa.value_or(surface.constant_pa), kLeast);
  result.theta = std::max(ice.shear_slope.value_or(surface.slope), kLeast);
  result.aspect_ratio = ice.cap_aspect_ratio;
  result.initial_intercept_pa = ice.cap_initial_intercept_pa;
  result.max_compaction = ice.cap_max_compaction;
  result.d1_per_pa = ice.cap_hardening_linear_per_pa;
  result.d2_per_pa2 = ice.cap_hardening_quadratic_per_pa2;
  result.bulk_modulus_pa = moduli.bulk_pa;
  result.shear_modulus_pa = moduli.shear_pa;
  result.stiffness_scale = stiffness_scale;
  result.flow_rule = ice.flow_rule;
  result.three_invariant = ice.three_invariant;
  result.gap_memory = ice.gap_memory;
  const double toughness = computeFractureToughness(ice.parent_fracture_toughness_pa_sqrt_m, ice.void_fraction);
  result.damages = ice.damage;
  result.damage.element_length_m = element_length_m;
  result.damage.fracture_energy_compression_jpm2 =
      computeCompressiveFractureEnergy(ice.parent_fracture_energy_compression_jpm2, ice.void_fraction);
  result.damage.fracture_energy_tension_jpm2 =
      computeTensileFractureEnergy(toughness, elastic_modulus, ice.poisson_ratio);
  result.damage.fracture_energy_shear_jpm2 = result.damage.fracture_energy_tension_jpm2;
  result.damage.ductile_shape = ice.damage_ductile_shape;
  result.damage.brittle_shape = ice.damage_brittle_shape;
  return result;
}

CapModel::CapModel(const CapParameters& parameters, InstructionSet set)
    : parameters_(parameters),
      softening_(parameters.damage),
      kernels_(&capKernels(set)),
      state_names_{"compaction", "plastic_strain"} {
  const CapParameters& p = parameters_;
  assert(p.alpha_pa > 0.0 && p.theta > 0.0 && p.aspect_ratio > 0.0 && p.initial_intercept_pa > 0.0);
  assert(p.max_compaction > 0.0 && p.max_compaction < 1.0 && p.d1_per_pa > 0.0 && p.d2_per_pa2 >= 0.0);
  assert(p.bulk_modulus_pa > 0.0 && p.shear_modulus_pa > 0.0 && p.stiffness_scale > 0.0);
  apex_ = p.alpha_pa / p.theta;
  width_ratio_ = p.aspect_ratio * p.theta / (1.0 + p.aspect_ratio * p.theta);
  // Associated: the top of F_f sqrt(F_c), root of 2 theta t² + t / R - theta. Non-associated: where the cap starts.
  const double inverse_ratio = 1.0 / p.aspect_ratio;
  neutral_ = p.flow_rule == FlowRule::kNonAssociated
                 ? 0.0
                 : 2.0 * p.theta / (inverse_ratio + std::sqrt(inverse_ratio * inverse_ratio + 8.0 * p.theta * p.theta));
  tangent_onset_ = std::numeric_limits<double>::infinity();
  virgin_ = capWithIntercept(p.initial_intercept_pa, 0.0);
  onset_ = capAt(kTangentOnset * p.max_compaction);
  tangent_onset_ = kTangentOnset * p.max_compaction;

  if (p.gap_memory) {
    gap_ = state_names_.size();
    state_names_.push_back("gap");
  }
  root_elastic_ = std::sqrt(9.0 * p.bulk_modulus_pa * p.shear_modulus_pa /
                            ((3.0 * p.bulk_modulus_pa + p.shear_modulus_pa) * p.stiffness_scale));
  if (p.damages) {
    damage_ = state_names_.size();
    state_names_.push_back("damage");
    for (const char* name : {"brittle_damage", "ductile_damage", "brittle_threshold", "ductile_threshold", "strain_xx",
                             "strain_yy", "strain_zz", "strain_xy", "strain_yz", "strain_zx"}) {
      state_names_.push_back(name);
    }
  }
  constants_ = makeConstants();
}

CapConstants CapModel::makeConstants() const {
  const CapParameters& p = parameters_;
  CapConstants c{};
  c.alpha_pa = p.alpha_pa;
  c.theta = p.theta;
  c.inverse_aspect_ratio = 1.0 / p.aspect_ratio;
  c.initial_intercept_pa = p.initial_intercept_pa;
  c.max_compaction = p.max_compaction;
  c.d1_per_pa = p.d1_per_pa;
  c.d2_per_pa2 = p.d2_per_pa2;
  c.bulk_modulus_pa = p.bulk_modulus_pa;
  c.shear_modulus_pa = p.shear_modulus_pa;
  c.stiffness_scale = p.stiffness_scale;
  c.apex_pa = apex_;
  c.width_ratio = width_ratio_;
  c.neutral = neutral_;
  c.tangent_onset = tangent_onset_;
  c.smallest_lode_factor = p.three_invariant ? kSmallestLodeFactor : 1.0;
  c.associated = p.flow_rule == FlowRule::kAssociated;
  c.gap_memory = p.gap_memory;
  c.damages = p.damages;
  // The Lode angle is rarely asked for.
  c.leaves_yielding = p.three_invariant;
  c.root_elastic = root_elastic_;
  c.element_length_m = p.damage.element_length_m;
  c.fracture_energy_compression_jpm2 = p.damage.fracture_energy_compression_jpm2;
  c.fracture_energy_tension_jpm2 = p.damage.fracture_energy_tension_jpm2;
  c.fracture_energy_shear_jpm2 = p.damage.fracture_energy_shear_jpm2;
  c.max_damage = Softening::kMaxDamage;
  c.ductile_shape = p.damage.ductile_shape;
  c.brittle_shape = p.damage.brittle_shape;
  c.ductile_log = softening_.ductileLog();
  c.ductile_dilog = softening_.ductileDilog();
  c.brittle_log = softening_.brittleLog();
  return c;
}

CapModel::Cap CapModel::capWithIntercept(double intercept, double hardening) const {
  const double width = width_ratio_ * (intercept + apex_);
  return {intercept, intercept - width, width, hardening};
}

CapModel::Cap CapModel::capAt(double compaction) const {
  const CapParameters& p = parameters_;
  if (!(compaction > 0.0)) return virgin_;
  if (compaction >= tangent_onset_) {
    return capWithIntercept(onset_.intercept + onset_.hardening * (compaction - tangent_onset_), onset_.hardening);
  }
  const double logarithm = -repeatable::log(1.0 - compaction / p.max_compaction);
  const double root = std::sqrt(p.d1_per_pa * p.d1_per_pa + 4.0 * p.d2_per_pa2 * logarithm);
  return capWithIntercept(p.initial_intercept_pa + 2.0 * logarithm / (p.d1_per_pa + root),
                          1.0 / ((p.max_compaction - compaction) * root));
}

/// Moduli count (1 - d) times.
double CapModel::elasticEnergyDensity(const std::array<float, kComponents>& stress_pa,
                                      const std::vector<float>& state) const {
  const double undamaged = Material::elasticEnergyDensity(stress_pa, state);
  return parameters_.damages ? undamaged / (1.0 - static_cast<double>(state[damage_])) : undamaged;
}

double CapModel::shearStrength(double j1_pa, double compaction) const {
  const Cap cap = capAt(compaction);
  const double t = std::max(0.0, (j1_pa - cap.start) / cap.width);
  return std::max(0.0, parameters_.alpha_pa + parameters_.theta * j1_pa) * std::sqrt(std::max(0.0, 1.0 - t * t));
}

/// Whether a trial stress lies inside the surface, but for what float stress and float compaction cannot resolve: a
/// returned stress must count as elastic in the next step, or rest would creep.
bool CapModel::isElastic(const Invariants& trial, double compaction, const Cap& cap) const {
  const double resolution = kStressResolution * (parameters_.alpha_pa + std::abs(trial.j1));
  const double cap_resolution = resolution + kCompactionResolution * std::max(0.0, compaction) * cap.hardening;
  const double cone = parameters_.alpha_pa + parameters_.theta * trial.j1 + resolution;
  const double t = std::max(0.0, (trial.j1 - cap_resolution - cap.start) / cap.width);
  return cone >= 0.0 && trial.s * trial.s <= cone * cone * (1.0 - t * t);
}

/// Yield function along the flow rule, after a plastic compaction x.
///
/// With m = -dF²/dJ1 the flow gives x = 3 lambda m and s (1 + 2 G lambda) = s_tr. Both together with f = 0 read
/// sqrt(F_c) D = N with D = 2 G x + 3 F_f h, N = 3 s_tr h, h = m / F_f, which divides by neither h nor F_f and so is
/// smooth at the neutral point and at the apex. Near the tip of the cap, where the root of F_c is not smooth, the
/// squares of both sides are compared. On the far side of the neutral point h counts as 0, which makes the value
/// positive and rules out roots with the wrong sign of x.
CapModel::Residual CapModel::computeResidual(double increment, const Cap& cap, const Invariants& trial,
                                             double shear) const {
  const CapParameters& p = parameters_;
  const double j1 = trial.j1 - 3.0 * p.bulk_modulus_pa * increment;
  const double cone = p.alpha_pa + p.theta * j1;
  const double cone_slope = -3.0 * p.bulk_modulus_pa * p.theta;
  const double width_slope = width_ratio_ * cap.hardening;
  const double inverse_width = 1.0 / cap.width;
  const double t = (j1 - cap.start) * inverse_width;
  const double t_slope = (-3.0 * p.bulk_modulus_pa - (cap.hardening - width_slope) - t * width_slope) * inverse_width;

  const bool on_cap = t > 0.0;
  const double shape = on_cap ? 1.0 - t * t : 1.0;
  double f_c = shape, f_c_slope = on_cap ? -2.0 * t * t_slope : 0.0;
  double h = 0.0, h_slope = 0.0;
  const bool compacts = increment > 0.0 || (increment == 0.0 && t > neutral_);
  if (compacts ? t > neutral_ : t < neutral_) {
    if (on_cap) {
      h = 2.0 * t * (1.0 / p.aspect_ratio + p.theta * t);
      h_slope = 2.0 * (1.0 / p.aspect_ratio + 2.0 * p.theta * t) * t_slope;
    }
    if (p.flow_rule == FlowRule::kAssociated) {
      h -= 2.0 * p.theta * shape;
      h_slope -= 2.0 * p.theta * f_c_slope;
    }
  } else if (!compacts) {
    f_c = 1.0 - neutral_ * neutral_;
    f_c_slope = 0.0;
  }
  const double d = 2.0 * shear * increment + 3.0 * cone * h;
  const double d_slope = 2.0 * shear + 3.0 * (cone_slope * h + cone * h_slope);
  const double n = 3.0 * trial.s * h;
  const double n_slope = 3.0 * trial.s * h_slope;
  const Invariants stress{j1, cone * std::sqrt(std::max(0.0, shape))};
  if (f_c < kTipOfCap) {
    return {f_c * d * d - n * n, f_c_slope * d * d + 2.0 * (f_c * d * d_slope - n * n_slope),
            (kResidualTolerance * std::max(0.0, f_c) + kTipTolerance) * d * d, stress};
  }
  const double root = std::sqrt(f_c), sign = compacts ? 1.0 : -1.0;
  return {sign * (root * d - n), sign * (root * d_slope + 0.5 * f_c_slope / root * d - n_slope),
          kResidualTolerance * root * std::abs(d), stress};
}

/// Backward Euler return of a trial outside the surface, in the plane of J1 and s (both for Q = 1).
/// @param shear  G, Pa, over Q²
CapModel::Returned CapModel::returnToSurface(const Invariants& trial, double shear, double compaction,
                                             const Cap& cap) const {
  const CapParameters& p = parameters_;
  const double bulk_3 = 3.0 * p.bulk_modulus_pa;
  const double trial_cone = p.alpha_pa + p.theta * trial.j1;
  const double to_apex = (trial.j1 + apex_) / bulk_3;
  const double trial_t = (trial.j1 - cap.start) / cap.width;

  // The value is negative at `outside` and positive at `inside`, where J1 is at the neutral point of the old cap.
  double outside = 0.0;
  double inside = (trial.j1 - (cap.start + neutral_ * cap.width)) / bulk_3;
  double x = 0.0;
  Cap moved = cap;
  if (!(trial_t > neutral_)) {
    if (p.flow_rule == FlowRule::kNonAssociated) {
      if (trial_cone <= 0.0) return {{-apex_, 0.0}, to_apex};
      return {{trial.j1, trial_cone}, 0.0};
    }
    // On the cone alone the answer is explicit.
    const double on_cone = -3.0 * p.theta * (trial.s - trial_cone) / (shear + 3.0 * bulk_3 * p.theta * p.theta);
    if (on_cone < 0.0) {
      const double j1 = trial.j1 - bulk_3 * on_cone;
      const double cone = p.alpha_pa + p.theta * j1;
      if (cone <= 0.0) return {{-apex_, 0.0}, to_apex};
      moved = capAt(compaction + on_cone);
      if (j1 <= moved.start) return {{j1, cone}, on_cone};
    }
    outside = std::min(0.0, to_apex);
    x = on_cone;
    if (!(x > inside && x < outside)) {
      x = outside;
      moved = capAt(compaction + x);
    }
  }

  // Newton's method inside the bracket. It ends on the residual, or where the bracket is as small as rounding allows;
  // a step that does not halve the one before is replaced by a halving of the bracket, and late ones all are.
  const double smallest_bracket =
      kBracketTolerance * ((std::abs(trial.j1) + p.alpha_pa) / bulk_3 + std::max(std::abs(inside), std::abs(outside)));
  double last_step = std::abs(inside - outside);
  for (int i = 0; i < kMaxIterations; ++i) {
    const Residual residual = computeResidual(x, moved, trial, shear);
    (residual.value < 0.0 ? outside : inside) = x;
    if (std::abs(residual.value) <= residual.tolerance || std::abs(inside - outside) <= smallest_bracket) {
      return {residual.stress, x};
    }
    double next = x - residual.value / residual.slope;
    const bool in_bracket = (next - outside) * (next - inside) < 0.0;
    if (!in_bracket || std::abs(next - x) > 0.5 * last_step || i > kMaxNewtonSteps) next = 0.5 * (outside + inside);
    last_step = std::abs(next - x);
    x = next;
    moved = capAt(compaction + x);
  }
  assert(false);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  return {{kNan, kNan}, 0.0};
}

/// Damage after a step, and the share of the stress that it leaves.
/// @param undamaged   stress on the surface or within
/// @param shears      whether this step flowed on the shear surface, i.e. without compaction
double CapModel::degradeStress(const MaterialBatch& batch, std::size_t i, const double* undamaged,
                               const Invariants& invariants, bool shears) const {
  float& applied = batch.state[damage_][i];
  float& brittle = batch.state[damage_ + 1][i];
  float& ductile = batch.state[damage_ + 2][i];
  float& brittle_threshold = batch.state[damage_ + 3][i];
  float& ductile_threshold = batch.state[damage_ + 4][i];
  // The part of the elastic strain that is there only because the modulus is scaled.
  const double excess = 1.0 - parameters_.stiffness_scale;
  const double excess_shear = 0.5 * excess / parameters_.shear_modulus_pa;
  const double excess_volume = invariants.j1 * (excess_shear / 3.0 - excess / (9.0 * parameters_.bulk_modulus_pa));
  double e[kComponents];
  for (std::size_t c = 0; c < kComponents; ++c) {
    float& total = batch.state[damage_ + 5 + c][i];
    total = toFloat(static_cast<double>(total) + static_cast<double>(batch.strain_increment[c][i]));
    e[c] = static_cast<double>(total) - excess_shear * undamaged[c] - (c < 3 ? excess_volume : 0.0);
  }

  // A crack that is still open carries no shear either.
  const bool tensile = invariants.j1 < 0.0 || (parameters_.gap_memory && batch.state[gap_][i] > 0.0f);
  float& threshold = tensile ? brittle_threshold : ductile_threshold;
  double measure = 0.0;
  if (tensile) {
    measure = root_elastic_ * largestPrincipal(e);
  } else {
    double product = 0.0;
    for (std::size_t c = 0; c < kComponents; ++c) product += (c < 3 ? 1.0 : 2.0) * undamaged[c] * e[c];
    measure = std::sqrt(std::max(0.0, 0.5 * product));
  }
  if (shears && threshold == 0.0f) threshold = toFloat(measure != 0.0 ? measure : 1e-30);
  const double growth = measure - static_cast<double>(threshold);
  if (threshold != 0.0f && growth > 0.0) {
    const double energy = softening_.fractureEnergy(invariants.j1, invariants.s);
    if (tensile) {
      const double strongest = largestPrincipal(undamaged) / root_elastic_;
      const double step = softening_.brittleRate(strongest, energy) * growth;
      raise(brittle, Softening::kMaxDamage * Softening::damage(step, parameters_.damage.brittle_shape));
    } else {
      const double step = softening_.ductileRate(static_cast<double>(threshold), energy) * growth;
      raise(ductile, Softening::maxDuctileDamage(invariants.j1, invariants.s) *
                         Softening::damage(step, parameters_.damage.ductile_shape));
    }
  }
  applied = tensile ? std::max(brittle, ductile) : ductile;
  return 1.0 - static_cast<double>(applied);
}

void CapModel::updateParticle(const MaterialBatch& batch, std::size_t i) const {
  const CapParameters& p = parameters_;
  const double integrity =
      p.damages ? 1.0 - std::min(Softening::kMaxDamage, static_cast<double>(batch.state[damage_][i])) : 1.0;
  double stress[kComponents], strain[kComponents];
  for (std::size_t c = 0; c < kComponents; ++c) {
    stress[c] = static_cast<double>(batch.stress[c][i]) / integrity;
    strain[c] = static_cast<double>(batch.strain_increment[c][i]);
  }
  const double volume_part = (p.bulk_modulus_pa - 2.0 / 3.0 * p.shear_modulus_pa) * (strain[0] + strain[1] + strain[2]);
  for (std::size_t c = 0; c < kComponents; ++c) {
    stress[c] += 2.0 * p.shear_modulus_pa * strain[c] + (c < 3 ? volume_part : 0.0);
  }
  if (p.gap_memory) {
    // Closing that would raise pressure takes away gap instead.
    const double gap = static_cast<double>(batch.state[gap_][i]);
    const double pressure_strain = -(stress[0] + stress[1] + stress[2]) / (3.0 * p.bulk_modulus_pa);
    const double closing = -(strain[0] + strain[1] + strain[2]);
    const double closed = std::min({gap, pressure_strain, closing});
    if (closed > 0.0) {
      for (std::size_t c = 0; c < 3; ++c) stress[c] += p.bulk_modulus_pa * closed;
      batch.state[gap_][i] = toFloat(gap - closed);
    }
  }
  const double j1 = -(stress[0] + stress[1] + stress[2]);
  const double d[kComponents] = {
      stress[0] + j1 / 3.0, stress[1] + j1 / 3.0, stress[2] + j1 / 3.0, stress[3], stress[4], stress[5]};
  const double s = std::sqrt(0.5 * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) + d[3] * d[3] + d[4] * d[4] + d[5] * d[5]);
  const double compaction = static_cast<double>(batch.state[0][i]);
  if (!std::isfinite(j1 + s + compaction + integrity)) {
    for (std::size_t c = 0; c < kComponents; ++c) batch.stress[c][i] = std::numeric_limits<float>::quiet_NaN();
    return;
  }

  double factor = 1.0;
  if (p.three_invariant && s > 0.0) {
    const double e[kComponents] = {d[0] / s, d[1] / s, d[2] / s, d[3] / s, d[4] / s, d[5] / s};
    const double determinant =
        e[0] * (e[1] * e[2] - e[4] * e[4]) - e[3] * (e[3] * e[2] - e[4] * e[5]) + e[5] * (e[3] * e[4] - e[1] * e[5]);
    factor = lodeFactor(-1.5 * std::sqrt(3.0) * determinant);
  }

  // Dividing s by Q and G by Q² turns the surface and its flow into those of Q = 1.
  const Invariants trial{j1, s / factor};
  const Cap cap = capAt(compaction);
  Invariants now{j1, s};
  bool shears = false;
  if (!isElastic(trial, compaction, cap)) {
    const Returned returned = returnToSurface(trial, p.shear_modulus_pa / (factor * factor), compaction, cap);
    now = {returned.stress.j1, std::min(s, factor * returned.stress.s)};
    shears = returned.increment <= 0.0;
    const double shrink = s > 0.0 ? now.s / s : 0.0;
    for (std::size_t c = 0; c < kComponents; ++c) stress[c] = shrink * d[c] - (c < 3 ? now.j1 / 3.0 : 0.0);
    const double shear_strain = (s - now.s) / (std::sqrt(3.0) * p.shear_modulus_pa);
    batch.state[0][i] = toFloat(std::max(0.0, compaction + returned.increment));
    batch.state[1][i] = toFloat(static_cast<double>(batch.state[1][i]) + shear_strain);
    if (p.gap_memory && returned.increment < 0.0 && now.j1 <= 0.0) {
      batch.state[gap_][i] = toFloat(static_cast<double>(batch.state[gap_][i]) - returned.increment);
    }
  }
  const double share = p.damages ? degradeStress(batch, i, stress, now, shears) : 1.0;
  for (std::size_t c = 0; c < kComponents; ++c) batch.stress[c][i] = toFloat(share * stress[c]);
}

void CapModel::update(MaterialBatch& batch) const {
  assert(batch.state.size() == stateNames().size());
  CapBatch arrays{};
  for (std::size_t c = 0; c < kComponents; ++c) {
    arrays.strain_increment[c] = batch.strain_increment[c];
    arrays.stress[c] = batch.stress[c];
  }
  arrays.state[kCompaction] = batch.state[0];
  arrays.state[kPlasticStrain] = batch.state[1];
  if (parameters_.gap_memory) arrays.state[kGap] = batch.state[gap_];
  if (parameters_.damages) std::copy_n(&batch.state[damage_], kCapStates - kDamage, &arrays.state[kDamage]);
  for (std::size_t begin = 0; begin < batch.count; begin += kCapTile) {
    std::uint32_t left[kCapTile];
    const std::size_t left_count =
        kernels_->update(constants_, arrays, begin, std::min(kCapTile, batch.count - begin), left);
    for (std::size_t n = 0; n < left_count; ++n) updateParticle(batch, begin + left[n]);
  }
}

void CapModel::updateOneByOne(MaterialBatch& batch) const {
  assert(batch.state.size() == stateNames().size());
  for (std::size_t i = 0; i < batch.count; ++i) updateParticle(batch, i);
}

}  // namespace brash_ice_rig
