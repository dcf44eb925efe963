#include "brash_ice_rig/identify/chain.h"

#include <algorithm>
#include <cmath>

#include "brash_ice_rig/material/cap_model.h"
#include "brash_ice_rig/math/angle.h"

namespace brash_ice_rig {
namespace {

/// Where the blocks lie exactly on a lattice, seeds would change nothing.
constexpr double kJitterRatio = 0.1;
/// Samples of a simulated force per second: five per bin.
constexpr double kSampleRateHz = 20.0;

// What is believed of the ice where the manifest does not say, as standard deviations.
constexpr double kVoidSigma = 0.06, kCohesionShare = 0.5, kFrictionSigmaDeg = 5.0;

}  // namespace

Eigen::VectorXd stacked(const std::vector<Eigen::VectorXd>& parts) {
  Eigen::Index size = 0;
  for (const Eigen::VectorXd& part : parts) size += part.size();
  Eigen::VectorXd all(size);
  size = 0;
  for (const Eigen::VectorXd& part : parts) {
    all.segment(size, part.size()) = part;
    size += part.size();
  }
  return all;
}

std::vector<IceUnknown> iceUnknowns(const Record& record) {
  const IceConfig& ice = record.scenario.ice;
  std::vector<IceUnknown> unknowns = {
      {"ice.void_fraction", "1", [](IceConfig& i, double value) { i.void_fraction = value; }, ice.void_fraction,
       kVoidSigma, 0.05, 0.95},
      {"ice.cohesion_pa", "Pa",
       [](IceConfig& i, double value) {
         scaleStrength(i, value / i.cohesion_pa);
         i.cohesion_pa = value;
       },
       ice.cohesion_pa, kCohesionShare * ice.cohesion_pa, 0.25 * ice.cohesion_pa, 4.0 * ice.cohesion_pa},
      {"ice.friction_angle_deg", "deg", [](IceConfig& i, double value) { i.friction_angle_deg = value; },
       ice.friction_angle_deg, kFrictionSigmaDeg, 5.0, 70.0}};
  for (IceUnknown& u : unknowns) {
    for (const KnownValue& known : record.ice) {
      if (known.key == u.key && known.sigma) u.sigma = *known.sigma;
    }
  }
  return unknowns;
}

RecordCurves readCurves(const NamedRecord& named) {
  RecordCurves curves;
  curves.path = named.path;
  curves.record = named.record;
  curves.report = checkRecord(curves.record);
  if (curves.report.usability() == Usability::kNo) {
    throw ConfigError(
        "", "", "nothing can be identified from this record:\n" + describe(named.path, curves.record, curves.report),
        named.path);
  }
  curves.observation = makeObservation(curves.record, curves.report);
  return curves;
}

Site Chain::makeSite(const NamedRecord& named) const {
  Site site;
  site.curves = readCurves(named);
  const std::vector<HoistStage> stages = stagesOf(site.observation().path);
  const auto own = std::find_if(discrepancies_.begin(), discrepancies_.end(), [&](const Discrepancy& d) {
    return d.fromReferences() && isSameProcedure(stages, d.procedure);
  });
  site.curves.procedure_known = own != discrepancies_.end();
  site.discrepancy = site.curves.procedure_known ? &*own : &discrepancies_.back();
  Scenario& s = site.scenario;
  s = site.curves.record.scenario;
  s.title = "identify";
  s.procedure.control = ControlMode::kScripted;
  s.procedure.motion_file = runs_.motionFile(site.observation().path);
  s.procedure.hold_duration_s = 0.0;
  s.procedure.start_gap_m += kGapM;
  if (s.field.jitter_ratio == 0.0) s.field.jitter_ratio = kJitterRatio;
  // With both of these given, cohesion and friction angle would change nothing.
  s.ice.shear_constant_pa.reset();
  s.ice.shear_slope.reset();
  s.load_cell = LoadCellConfig();
  s.load_cell.rate_hz = kSampleRateHz;
  s.output = OutputConfig();
  s.solver.threads = 1;
  s.validate();
  return site;
}

Scenario Chain::scenarioAt(const Site& site, const Eigen::VectorXd& x, const std::vector<const Variant*>& variants,
                           int seed) const {
  Scenario s = site.scenario;
  s.field.seed = static_cast<std::uint64_t>(seed);
  for (std::size_t k = 0; k < ice_.size(); ++k) {
    ice_[k].set(s.ice, std::clamp(ice_[k].prior + x[static_cast<Eigen::Index>(k)], ice_[k].low, ice_[k].high));
  }
  s.procedure.start_gap_m = std::max(s.procedure.start_gap_m + x[site.own()], 0.0);
  Eigen::Index column = unknowns();
  for (const Variant* v : variants) {
    const auto count = static_cast<Eigen::Index>(v->amplitudes.size());
    if (!v->effect->reading_only) site.apply(*v, x.segment(column, count), s);
    column += count;
  }
  return s;
}

/// A simulated force as the load cell shows it under those effects of a model that only change the reading.
SimulatedForce Chain::asRead(SimulatedForce force, const Scenario& scenario, const Eigen::VectorXd& x,
                             const std::vector<const Variant*>& variants) const {
  Eigen::Index column = unknowns();
  for (const Variant* v : variants) {
    const auto count = static_cast<Eigen::Index>(v->amplitudes.size());
    if (v->effect->reading_only) {
      EffectValues values(*v->effect);
      v->apply(values, x.segment(column, count));
      force = throughLoadCell(values, scenario, force);
    }
    column += count;
  }
  return force;
}

/// Adds the first record's lateral channels, turned to where most of the force is and across.
void Chain::addLateralSites() {
  const Observation& all = sites_.front().observation();
  if (all.lateral_n.rows() == 0 || !all.ice_contact) return;
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  for (Eigen::Index i = 0; i < all.time_s.size(); ++i) {
    if (all.time_s[i] > 0.0) sum += all.lateral_n.row(i).transpose() * all.lateral_n.row(i);
  }
  constexpr double kGridDeg = 5.0;
  lateral_direction_deg_ =
      kGridDeg * std::round(0.5 * std::atan2(2.0 * sum(0, 1), sum(0, 0) - sum(1, 1)) / kDegree / kGridDeg);
  const std::vector<Site> lateral = lateralSites(sites_.front());
  sites_.insert(sites_.end(), lateral.begin(), lateral.end());
}

/// The lateral channels of a record in the directions of the first one's; none where it has none. A quarter of the
/// bins: the pole moves slowly, and each row costs.
std::vector<Site> Chain::lateralSites(const Site& vertical) const {
  std::vector<Site> sites;
  const Observation& all = vertical.observation();
  if (!lateral_direction_deg_ || all.lateral_n.rows() == 0 || !all.ice_contact) return sites;
  for (const double across_deg : {0.0, 90.0}) {
    Site site;
    site.curves.path = vertical.curves.path;
    site.curves.record = vertical.curves.record;
    site.discrepancy = vertical.discrepancy;
    site.scenario = vertical.scenario;
    site.direction_rad = (*lateral_direction_deg_ + across_deg) * kDegree;
    const Eigen::Index count = (all.time_s.size() + kLateralThinning - 1) / kLateralThinning;
    Observation& o = site.curves.observation;
    o = all;
    for (Eigen::VectorXd* rows : {&o.time_s, &o.force_n, &o.way_m, &o.travel_m}) rows->resize(count);
    double square = 0.0, at_rest = 0.0;
    for (Eigen::Index i = 0; i < count; ++i) {
      const Eigen::Index from = i * kLateralThinning;
      o.time_s[i] = all.time_s[from];
      o.way_m[i] = all.way_m[from];
      o.travel_m[i] = all.travel_m[from];
      o.force_n[i] = all.lateral_n(from, 0) * std::cos(*site.direction_rad) +
                     all.lateral_n(from, 1) * std::sin(*site.direction_rad);
      if (o.time_s[i] > -0.5) continue;
      square += o.force_n[i] * o.force_n[i];
      at_rest += 1.0;
    }
    const double sigma = at_rest > 0.0 ? std::max(std::sqrt(square / at_rest), 1.0) : all.noise.white_n;
    o.noise = {sigma, sigma};
    sites.push_back(site);
  }
  return sites;
}

/// A run of the baseline as given, or with one of its unknowns moved.
std::string Chain::requestBaseline(const Site& site, int seed, Eigen::Index unknown, double step) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(unknowns());
  if (unknown >= 0) x[unknown] = step;
  return runs_.request(scenarioAt(site, x, {}, seed));
}

std::vector<Chain::Slope> Chain::slopesOf(const Site& site) const {
  std::vector<Slope> slopes;
  for (Eigen::Index k = 0; k < kIceUnknowns; ++k) slopes.push_back({k, k, ice_[static_cast<std::size_t>(k)].sigma});
  slopes.push_back({kIceUnknowns, site.own(), kGapSigmaM});
  return slopes;
}

void Chain::simulateBaseline() {
  for (const Site& site : sites_) {
    for (int seed = 1; seed <= site.seeds(); ++seed) requestBaseline(site, seed);
    if (!site.observation().ice_contact) continue;
    for (const Slope& slope : slopesOf(site)) {
      for (int seed = 1; seed <= kPairs; ++seed) requestBaseline(site, seed, slope.unknown, slope.step);
    }
  }
  if (!baseline_only_) addVariants();
  for (const Site& site : sites_) {
    for (const auto& v : variants_) requestSignature(site, *v);
    if (swell_) requestSignature(site, *swell_);
  }
  runs_.makeMissing("baseline and what effects do");
  for (Site& site : sites_) readBaseline(site);
  stackRecords();
}

/// The force of the baseline as given, how its arrangements of the blocks differ, and its slopes.
void Chain::readBaseline(Site& site) {
  const Observation& o = site.observation();
  const int seeds = site.seeds();
  Eigen::MatrixXd forces(site.rows(), seeds), corrected_forces(site.rows(), seeds);
  Eigen::VectorXd rate = Eigen::VectorXd::Zero(site.rows());
  for (int seed = 1; seed <= seeds; ++seed) {
    const std::string key = requestBaseline(site, seed);
    if (runs_.failed(key)) {
      throw ConfigError("", "", "the simulation of this record's rig and ice freezes", site.curves.path);
    }
    const SimulatedForce known = corrected(site, key);
    constexpr double kShiftS = 0.05;
    forces.col(seed - 1) = site.bins(runs_.force(key));
    corrected_forces.col(seed - 1) = site.bins(known);
    rate += (site.bins(known, kShiftS) - site.bins(known, -kShiftS)) / (2.0 * kShiftS * seeds);
  }
  site.mean_n = forces.rowwise().mean();
  site.start_n = corrected_forces.rowwise().mean();
  site.known_share = Eigen::VectorXd::Zero(site.rows());
  if (site.direction_rad) {
    // What one arrangement of the blocks pushes aside, another does not: scatter, and no more.
    site.mean_n.setZero();
    site.start_n.setZero();
  } else if (o.ice_contact) {
    site.known_share = computeKnownShare(*site.discrepancy, o.path, o.time_s, o.way_m);
  }
  site.chaos_n = Eigen::VectorXd::Zero(site.rows());
  if (seeds > 1) {
    const Eigen::VectorXd variance = (forces.colwise() - site.mean_n).rowwise().squaredNorm() / (seeds - 1);
    // Few seeds: averaged over 4 s.
    for (Eigen::Index row = 0; row < site.rows(); ++row) {
      const Eigen::Index from = std::max<Eigen::Index>(row - 8, 0), to = std::min(row + 8, site.rows() - 1);
      site.chaos_n[row] = std::sqrt(variance.segment(from, to - from + 1).mean());
    }
  }
  site.slopes = Eigen::MatrixXd::Zero(site.rows(), kIceUnknowns + kOwnUnknowns);
  if (site.direction_rad) return;
  site.slopes.col(kIceUnknowns + 1) = rate;
  if (!o.ice_contact) return;
  for (const Slope& slope : slopesOf(site)) {
    for (int seed = 1; seed <= kPairs; ++seed) {
      const std::string key = requestBaseline(site, seed, slope.unknown, slope.step);
      if (runs_.failed(key)) continue;
      site.slopes.col(slope.column) +=
          (site.bins(corrected(site, key)) - corrected_forces.col(seed - 1)) / (slope.step * kPairs);
    }
  }
}

/// The force of the baseline with the ice that the manifest states, in all rows.
Eigen::VectorXd Chain::baselineAsStated() const {
  std::vector<Eigen::VectorXd> parts;
  for (const Site& site : sites_) parts.push_back(site.start_n);
  return stacked(parts);
}

/// All records in one.
void Chain::stackRecords() {
  std::vector<Eigen::VectorXd> data;
  Eigen::Index rows = 0;
  for (Site& site : sites_) {
    site.first_row = rows;
    rows += site.rows();
    if (!site.direction_rad) record_rows_ = rows;
    data.push_back(site.observation().force_n);
  }
  data_ = stacked(data);
  baseline_offset_ = baselineAsStated();
  baseline_columns_ = Eigen::MatrixXd::Zero(rows, unknowns());
  for (const Site& site : sites_) {
    baseline_columns_.block(site.first_row, 0, site.rows(), kIceUnknowns) = site.slopes.leftCols(kIceUnknowns);
    baseline_columns_.block(site.first_row, site.own(), site.rows(), kOwnUnknowns) =
        site.slopes.rightCols(kOwnUnknowns);
  }
  setErrors(baseline_offset_, Eigen::VectorXd::Zero(unknowns()));
}

/// Covariance of what a lateral channel is off: what arrangements of the blocks differ by, and what a cell reads
/// sideways that hangs one degree off the vertical, a fifth of it more or less as the lift goes on.
Eigen::MatrixXd Chain::lateralDiscrepancy(const Site& site, const Site& vertical) const {
  constexpr double kAskewRad = kDegree, kChangingShare = 0.2;
  Eigen::VectorXd askew_n(site.rows());
  for (Eigen::Index i = 0; i < site.rows(); ++i) askew_n[i] = kAskewRad * vertical.mean_n[i * kLateralThinning];
  const Eigen::VectorXd changing_n =
      (site.chaos_n.array().square() + (kChangingShare * askew_n).array().square()).sqrt();
  Discrepancy whole;
  whole.form_share = 1.0;
  return computeFormCovariance(whole, site.observation(), changing_n, 0.0) + askew_n * askew_n.transpose();
}

/// Covariance of what the simulator is off for a force as large as this curve of the baseline. Its shape is that of the
/// baseline as given: where a refitted one touches the ice later, it would leave no allowance there.
Eigen::MatrixXd Chain::discrepancyOf(const Site& site, const Eigen::VectorXd& curve_n) const {
  const double given = computeLevel(site.mean_n), wanted = computeLevel(site.uncorrected(curve_n));
  const double scale = given > 0.0 ? wanted / given : 1.0;
  return iceFactor(site) *
         computeDiscrepancyCovariance(*site.discrepancy, site.observation(), scale * site.mean_n, site.chaos_n);
}

/// What noise and simulator may be off, the latter for a force as large as this curve of the baseline and the ice of x.
void Chain::setErrors(const Eigen::VectorXd& curve_n, const Eigen::VectorXd& x) {
  for (Eigen::Index k = 0; k < kIceUnknowns; ++k) {
    const IceUnknown& unknown = ice_[static_cast<std::size_t>(k)];
    ice_at_[k] = unknown.prior + x[k];
    ice_sigma_[k] = unknown.sigma;
  }
  errors_.noise = errors_.discrepancy = Eigen::MatrixXd::Zero(curve_n.size(), curve_n.size());
  for (const Site& site : sites_) {
    errors_.noise.block(site.first_row, site.first_row, site.rows(), site.rows()) =
        computeNoiseCovariance(site.observation().noise, site.observation().time_s);
    if (!site.observation().ice_contact) continue;
    // A lateral channel says nothing of the scale of what the simulator is off in the lift.
    if (site.direction_rad) {
      errors_.noise.block(site.first_row, site.first_row, site.rows(), site.rows()) +=
          lateralDiscrepancy(site, sites_[site.record]);
      continue;
    }
    errors_.discrepancy.block(site.first_row, site.first_row, site.rows(), site.rows()) =
        discrepancyOf(site, curve_n.segment(site.first_row, site.rows()));
  }
}

}  // namespace brash_ice_rig
