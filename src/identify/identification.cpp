#include "brash_ice_rig/identify/identification.h"

#include <algorithm>
#include <cassert>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <tuple>

#include "brash_ice_rig/identify/overlay.h"
#include "brash_ice_rig/identify/verdict.h"
#include "brash_ice_rig/material/cap_model.h"

namespace brash_ice_rig {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Arrangements of the blocks, seeds from 1 on: those from which the simulator's own scatter is known, and those on
// which differences are taken.
constexpr int kEnsemble = 6, kPairs = 2;
/// Where the blocks lie exactly on a lattice, seeds would change nothing.
constexpr double kJitterRatio = 0.1;
/// Samples of a simulated force per second: five per bin.
constexpr double kSampleRateHz = 20.0;
/// Explanations that are confirmed by simulation, and the passes of Gauss-Newton for each.
constexpr std::size_t kConfirmed = 4;
/// ln of the Bayes factor below which a straight line's verdict is final: a simulation would not make up for 5.
constexpr double kWorthSimulating = 1.0;
constexpr int kPasses = 2;
/// Swell whose effect is simulated in order to know what others would do.
constexpr double kSwellPeriodS = 6.0;
/// Of a lateral channel every so many bins count.
constexpr Eigen::Index kLateralThinning = 4;
/// Where references say how far the simulator is off, nothing is known better than this share of the largest force.
constexpr double kReferenceFloor = 0.005;

// What is believed of the ice where the manifest does not say, as standard deviations.
constexpr double kVoidSigma = 0.06, kCohesionShare = 0.5, kFrictionSigmaDeg = 5.0;
/// Water between rim and ice at the start that nobody measured, m: as the mean of what is believed, and how far from
/// it. Without any, the rig would already carry ice at rest, and a cell that was zeroed there would seem to err.
constexpr double kGapM = 0.03, kGapSigmaM = 0.04;

// Unknowns of the baseline: those of the ice, which records share, then two for each record.
constexpr Eigen::Index kIceUnknowns = 3, kOwnUnknowns = 2;

/// What is fitted of the ice. Cohesion stands for its strength.
struct IceUnknown {
  const char *key, *unit;
  void (*set)(IceConfig& ice, double value);
  double prior, sigma, low, high;
};

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

/// One channel of a record, with its simulations.
struct Site {
  RecordCurves curves;
  std::size_t record = 0;               ///< whose own unknowns it has
  std::optional<double> direction_rad;  ///< of a lateral channel, from x towards y
  Scenario scenario;                    ///< of the baseline as given
  Eigen::VectorXd mean_n, chaos_n;      ///< of the baseline as given, as simulated
  Eigen::VectorXd known_share;          ///< what the simulator is known to be off, over the level of its force
  Eigen::VectorXd start_n;              ///< the baseline as given with that
  Eigen::MatrixXd slopes;               ///< a column per unknown of the baseline that this record has: ice, gap, clock
  Eigen::Index first_row = 0;

  const Observation& observation() const { return curves.observation; }
  Eigen::Index rows() const { return curves.observation.time_s.size(); }
  Eigen::Index own() const { return kIceUnknowns + kOwnUnknowns * static_cast<Eigen::Index>(record); }
  Eigen::VectorXd bins(const SimulatedForce& f, double delay_s = 0.0) const {
    const Eigen::VectorXd& at = curves.observation.time_s;
    if (direction_rad) {
      return std::cos(*direction_rad) * binned(f.time_s, f.force_x_n, at, delay_s) +
             std::sin(*direction_rad) * binned(f.time_s, f.force_y_n, at, delay_s);
    }
    return binned(f.time_s, curves.observation.ice_contact ? f.force_n : f.empty_force_n, at, delay_s);
  }
  /// The baseline as given, but as large as another one.
  Eigen::VectorXd scaledTo(double level_n) const {
    const double given = computeLevel(mean_n);
    return given > 0.0 ? Eigen::VectorXd(level_n / given * mean_n) : mean_n;
  }
  /// A force in bins without what the simulator is known to be off.
  Eigen::VectorXd uncorrected(const Eigen::VectorXd& force_n) const {
    const double level = computeLevel(force_n - computeLevel(mean_n) * known_share);
    return force_n - level * known_share;
  }
};

/// A model at the point where it was simulated last.
struct Model {
  std::vector<const Variant*> variants;
  double screened = 0.0;        ///< ln of the Bayes factor before anything was simulated
  LinearFit screened_fit;       ///< likewise
  double shape_log_odds = 0.0;  ///< what the choice of the shape costs, <= 0
  Eigen::VectorXd offset;       ///< such that offset + columns x is the force
  Eigen::MatrixXd effect_columns;
  LinearFit fit;
  UnknownDensity density;                    ///< of its amplitude, where it has one; empty otherwise
  std::vector<UnknownDensity> other_shapes;  ///< the same of the effect's other shapes, as screened
  Eigen::VectorXd x;                         ///< at which it was simulated
  Eigen::VectorXd curve_n;                   ///< simulated there
  bool simulated = false, frozen = false;
};

/// ln of the evidence of an effect in its best shape, the choice of the shape counted.
double score(const Model& m) {
  return m.fit.log_evidence + m.shape_log_odds;
}

class Chain {
 public:
  Chain(const IdentifyInput& input, RunLibrary& runs, const Thresholds& thresholds, const Discrepancy& discrepancy)
      : input_(input), runs_(runs), thresholds_(thresholds), discrepancy_(discrepancy) {}

  Identification run();

  /// What is left of a lift without an effect after its baseline was refitted, and simulated there if asked. Nothing of
  /// one without ice.
  std::optional<ReferenceLift> reference(bool simulate);

 private:
  Site makeSite(const NamedRecord& named) const;
  Scenario scenarioAt(const Site& site, const Eigen::VectorXd& x, const std::vector<const Variant*>& variants,
                      int seed) const;
  Eigen::Index unknowns() const { return kIceUnknowns + kOwnUnknowns * static_cast<Eigen::Index>(records_); }
  SimulatedForce corrected(const std::string& key) const {
    return correctKnownDiscrepancy(discrepancy_, runs_.force(key));
  }
  SimulatedForce asRead(SimulatedForce force, const Scenario& scenario, const Eigen::VectorXd& x,
                        const std::vector<const Variant*>& variants) const;
  void addLateralSites();
  Eigen::MatrixXd lateralDiscrepancy(const Site& site) const;
  void simulateBaseline();
  void setErrors(const Eigen::VectorXd& curve_n, const Eigen::VectorXd& x);
  void addVariants();
  void computeSignatures(const std::vector<const Variant*>& variants, const std::string& what);
  std::vector<std::string> requestSignature(const Site& site, const Variant& variant);
  Eigen::MatrixXd signature(const Site& site, const Variant& variant);
  LinearModel linearModel(const Model& model) const;
  Eigen::MatrixXd formErrors(const Model& model, const Eigen::VectorXd& amplitudes) const;
  void refit(Model& model) const;
  Model linear(const std::vector<const Variant*>& variants) const;
  double findPlaces(const Model& start, const std::vector<double>& places, const Amplitude& prior,
                    const std::function<Eigen::MatrixXd(double)>& columns, std::vector<double>& found,
                    double& log_odds) const;
  void locate(const Model& start, const std::string& what);
  void confirm(const std::vector<Model*>& models, const std::string& what);
  Eigen::VectorXd clipped(const Model& model, Eigen::VectorXd x) const;
  std::optional<Eigen::VectorXd> simulated(const Model& model, const Eigen::VectorXd& x, bool request_only);
  /// What is left of the records, lateral channels apart, in units of what is allowed.
  Eigen::VectorXd whitened(const Model& model) const { return model.fit.whitened.head(record_rows_); }
  double chi2PerBin(const Model& model) const {
    return whitened(model).squaredNorm() / static_cast<double>(record_rows_);
  }
  Explanation explain(const Model& model, const Model& baseline, const Detectability& detectability) const;
  void addSecondEffect(std::vector<Model>& models, const Model& baseline);
  void evaluateHoldout(const Model& baseline, const std::vector<Model>& models, Identification& result);
  void addDetectable(Identification& result, const Detectability& detectability) const;

  const IdentifyInput& input_;
  bool baseline_only_ = false;
  RunLibrary& runs_;
  const Thresholds& thresholds_;
  const Discrepancy& discrepancy_;
  std::vector<Site> sites_;  ///< records first, then the lateral channels of the first one
  std::size_t records_ = 0;
  std::optional<double> lateral_direction_deg_;  ///< where most of the lateral force is
  Eigen::Index record_rows_ = 0;                 ///< of the records, without lateral channels
  std::vector<IceUnknown> ice_;
  std::vector<std::unique_ptr<Variant>> variants_;
  std::unique_ptr<Variant> swell_;  ///< of kSwellPeriodS, from which those of other periods follow
  std::map<const Variant*, Eigen::MatrixXd> signatures_;
  std::map<const Variant*, double> located_log_odds_;  ///< of falls and swell: for having looked at many times
  Eigen::VectorXd data_;
  ErrorModel errors_;
  double ice_factor_ = 1.0;  ///< that is in them
  Eigen::MatrixXd baseline_columns_;
  Eigen::VectorXd baseline_offset_;
  struct Predicted {
    Eigen::VectorXd curve_n;
    CurveError error;
  };
  std::vector<Predicted> predicted_;  ///< of the held-out record, in the order of the ranking; empty without a curve
};

Site Chain::makeSite(const NamedRecord& named) const {
  Site site;
  site.curves.path = named.path;
  site.curves.record = named.record;
  site.curves.report = checkRecord(site.curves.record);
  if (site.curves.report.usability() == Usability::kNo) {
    throw ConfigError(
        "", "",
        "nothing can be identified from this record:\n" + describe(named.path, site.curves.record, site.curves.report),
        named.path);
  }
  site.curves.observation = makeObservation(site.curves.record, site.curves.report);
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
    if (!v->effect->reading_only) v->apply(s.effects[v->effect->name], x.segment(column, count));
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

void Chain::simulateBaseline() {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(unknowns());
  std::vector<std::vector<std::string>> keys(sites_.size());
  const auto moved = [&](std::size_t i, Eigen::Index unknown, double step, int seed) {
    Eigen::VectorXd x = zero;
    x[unknown] = step;
    return runs_.request(scenarioAt(sites_[i], x, {}, seed));
  };
  struct Slope {
    Eigen::Index column, unknown;
    double step;
  };
  const auto slopesOf = [&](std::size_t i) {
    std::vector<Slope> slopes;
    for (Eigen::Index k = 0; k < kIceUnknowns; ++k) slopes.push_back({k, k, ice_[static_cast<std::size_t>(k)].sigma});
    slopes.push_back({kIceUnknowns, sites_[i].own(), kGapSigmaM});
    return slopes;
  };
  for (int pass = 0; pass < 2; ++pass) {
    for (std::size_t i = 0; i < sites_.size(); ++i) {
      Site& site = sites_[i];
      const int seeds = site.observation().ice_contact ? kEnsemble : 1;
      if (pass == 0) {
        for (int seed = 1; seed <= seeds; ++seed) keys[i].push_back(runs_.request(scenarioAt(site, zero, {}, seed)));
        if (!site.observation().ice_contact) continue;
        for (const Slope& slope : slopesOf(i)) {
          for (int seed = 1; seed <= kPairs; ++seed) moved(i, slope.unknown, slope.step, seed);
        }
        continue;
      }
      Eigen::MatrixXd forces(site.rows(), seeds), corrected_forces(site.rows(), seeds);
      Eigen::VectorXd rate = Eigen::VectorXd::Zero(site.rows());
      for (int seed = 0; seed < seeds; ++seed) {
        const std::string& key = keys[i][static_cast<std::size_t>(seed)];
        if (runs_.failed(key))
          throw ConfigError("", "", "the simulation of this record's rig and ice freezes", site.curves.path);
        const SimulatedForce known = corrected(key);
        constexpr double kShiftS = 0.05;
        forces.col(seed) = site.bins(runs_.force(key));
        corrected_forces.col(seed) = site.bins(known);
        rate += (site.bins(known, kShiftS) - site.bins(known, -kShiftS)) / (2.0 * kShiftS * seeds);
      }
      site.mean_n = forces.rowwise().mean();
      site.start_n = corrected_forces.rowwise().mean();
      site.known_share = Eigen::VectorXd::Zero(site.rows());
      if (site.direction_rad) {
        // What one arrangement of the blocks pushes aside, another does not: scatter, and no more.
        site.mean_n.setZero();
        site.start_n.setZero();
      } else if (site.observation().ice_contact) {
        site.known_share = computeKnownShare(discrepancy_, site.observation().time_s, site.observation().way_m);
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
      if (site.direction_rad) continue;
      site.slopes.col(kIceUnknowns + 1) = rate;
      if (!site.observation().ice_contact) continue;
      for (const Slope& slope : slopesOf(i)) {
        for (int seed = 1; seed <= kPairs; ++seed) {
          const std::string key = moved(i, slope.unknown, slope.step, seed);
          if (runs_.failed(key)) continue;
          site.slopes.col(slope.column) +=
              (site.bins(corrected(key)) - corrected_forces.col(seed - 1)) / (slope.step * kPairs);
        }
      }
    }
    if (pass == 0) {
      if (!baseline_only_) addVariants();
      for (const auto& v : variants_) {
        for (const Site& site : sites_) requestSignature(site, *v);
      }
      if (swell_) {
        for (const Site& site : sites_) requestSignature(site, *swell_);
      }
      runs_.makeMissing("baseline and what effects do");
    }
  }

  // All records in one.
  std::vector<Eigen::VectorXd> data, offsets;
  Eigen::Index rows = 0;
  for (Site& site : sites_) {
    site.first_row = rows;
    rows += site.rows();
    if (!site.direction_rad) record_rows_ = rows;
    data.push_back(site.observation().force_n);
    offsets.push_back(site.start_n);
  }
  data_ = stacked(data);
  baseline_offset_ = stacked(offsets);
  baseline_columns_ = Eigen::MatrixXd::Zero(rows, unknowns());
  for (const Site& site : sites_) {
    baseline_columns_.block(site.first_row, 0, site.rows(), kIceUnknowns) = site.slopes.leftCols(kIceUnknowns);
    baseline_columns_.block(site.first_row, site.own(), site.rows(), kOwnUnknowns) =
        site.slopes.rightCols(kOwnUnknowns);
  }
  setErrors(baseline_offset_, Eigen::VectorXd::Zero(unknowns()));
}

/// What noise and simulator may be off, the latter for a force as large as this curve of the baseline and the ice of x.
void Chain::setErrors(const Eigen::VectorXd& curve_n, const Eigen::VectorXd& x) {
  IceValues ice, sigma;
  for (Eigen::Index k = 0; k < kIceUnknowns; ++k) {
    const IceUnknown& unknown = ice_[static_cast<std::size_t>(k)];
    ice[k] = unknown.prior + x[k];
    sigma[k] = unknown.sigma;
  }
  ice_factor_ = computeIceFactor(discrepancy_, ice, sigma);
  errors_.noise = errors_.discrepancy = Eigen::MatrixXd::Zero(curve_n.size(), curve_n.size());
  for (const Site& site : sites_) {
    errors_.noise.block(site.first_row, site.first_row, site.rows(), site.rows()) =
        computeNoiseCovariance(site.observation().noise, site.observation().time_s);
    if (!site.observation().ice_contact) continue;
    // A lateral channel says nothing of the scale of what the simulator is off in the lift.
    if (site.direction_rad) {
      errors_.noise.block(site.first_row, site.first_row, site.rows(), site.rows()) += lateralDiscrepancy(site);
      continue;
    }
    // The shape of the baseline as given: where a refitted one touches the ice later, it would leave no allowance
    // there.
    const double level = computeLevel(site.uncorrected(curve_n.segment(site.first_row, site.rows())));
    const Eigen::VectorXd ice_n = site.scaledTo(level);
    errors_.discrepancy.block(site.first_row, site.first_row, site.rows(), site.rows()) =
        ice_factor_ * computeDiscrepancyCovariance(discrepancy_, site.observation(), ice_n, site.chaos_n);
  }
}

/// Covariance of what a lateral channel is off: what arrangements of the blocks differ by, and the share of the force
/// that a cell reads sideways which hangs one degree off the vertical.
Eigen::MatrixXd Chain::lateralDiscrepancy(const Site& site) const {
  constexpr double kAskewRad = 0.0175;
  const Site& vertical = sites_[site.record];
  Eigen::VectorXd sigma(site.rows());
  for (Eigen::Index i = 0; i < site.rows(); ++i) {
    sigma[i] = std::hypot(site.chaos_n[i], kAskewRad * vertical.mean_n[i * kLateralThinning]);
  }
  Discrepancy whole;
  whole.form_share = 1.0;
  return computeFormCovariance(whole, site.observation(), sigma);
}

/// The first record's lateral channels, turned to where most of the force is and across. A quarter of the bins: the
/// pole moves slowly, and each row costs.
void Chain::addLateralSites() {
  const Site vertical = sites_.front();  // a copy: sites_ grows
  const Observation& all = vertical.observation();
  if (all.lateral_n.rows() == 0 || !all.ice_contact) return;
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  for (Eigen::Index i = 0; i < all.time_s.size(); ++i) {
    if (all.time_s[i] > 0.0) sum += all.lateral_n.row(i).transpose() * all.lateral_n.row(i);
  }
  constexpr double kDegree = 3.14159265358979323846 / 180.0, kGridDeg = 5.0;
  lateral_direction_deg_ =
      kGridDeg * std::round(0.5 * std::atan2(2.0 * sum(0, 1), sum(0, 0) - sum(1, 1)) / kDegree / kGridDeg);
  for (const double across_deg : {0.0, 90.0}) {
    Site site;
    site.curves.path = vertical.curves.path;
    site.curves.record = vertical.curves.record;
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
    sites_.push_back(site);
  }
}

void Chain::addVariants() {
  // A position that was only commanded in one of the records leaves the hoist's losses open.
  PositionOrigin position = PositionOrigin::kMeasured;
  for (const Site& site : sites_) {
    if (site.curves.record.position == PositionOrigin::kCommanded) position = PositionOrigin::kCommanded;
  }
  for (const EffectDescription& effect : effectRegistry()) {
    if (sites_.front().scenario.effects[effect.name].enabled) continue;  // the baseline has it already
    const bool seen_sideways = lateral_direction_deg_ && std::string(effect.name) == "pole_tilt";
    for (Variant& variant : seen_sideways ? makeTilts(*lateral_direction_deg_) : makeVariants(effect, position)) {
      variants_.push_back(std::make_unique<Variant>(std::move(variant)));
    }
    if (std::string(effect.name) == "vessel_heave" && sites_.front().observation().ice_contact) {
      swell_ = std::make_unique<Variant>(makeSwell({kSwellPeriodS}));
    }
  }
}

/// Keys of the runs with each amplitude at its step, seed by seed; empty where no run is needed or none is possible.
std::vector<std::string> Chain::requestSignature(const Site& site, const Variant& v) {
  if (v.effect->reading_only || !site.observation().ice_contact) return {};
  std::vector<std::string> keys;
  for (std::size_t k = 0; k < v.amplitudes.size(); ++k) {
    for (int seed = 1; seed <= kPairs; ++seed) {
      Scenario s = site.scenario;
      s.field.seed = static_cast<std::uint64_t>(seed);
      Eigen::VectorXd a = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(v.amplitudes.size()));
      a[static_cast<Eigen::Index>(k)] = v.amplitudes[k].step;
      v.apply(s.effects[v.effect->name], a);
      try {
        s.validate();
      } catch (const ConfigError&) {
        return {};  // such an amplitude is impossible in this ice
      }
      keys.push_back(runs_.request(s));
    }
  }
  return keys;
}

Eigen::MatrixXd Chain::signature(const Site& site, const Variant& v) {
  const auto count = static_cast<Eigen::Index>(v.amplitudes.size());
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(site.rows(), count);
  if (site.direction_rad && !v.effect->acts_sideways) return columns;
  const auto plain = [&](int seed) {
    Scenario s = site.scenario;
    s.field.seed = static_cast<std::uint64_t>(site.observation().ice_contact ? seed : 1);
    return corrected(runs_.request(s));
  };
  const std::vector<std::string> keys = requestSignature(site, v);
  for (Eigen::Index k = 0; k < count; ++k) {
    const double step = v.amplitudes[static_cast<std::size_t>(k)].step;
    for (int seed = 1; seed <= kPairs; ++seed) {
      const Eigen::VectorXd before = site.bins(plain(seed));
      if (v.effect->reading_only) {
        Eigen::VectorXd a = Eigen::VectorXd::Zero(count);
        a[k] = step;
        EffectValues values(*v.effect);
        v.apply(values, a);
        columns.col(k) += (site.bins(throughLoadCell(values, site.scenario, plain(seed))) - before) / (step * kPairs);
      } else if (!keys.empty()) {
        const std::string& key = keys[static_cast<std::size_t>(k * kPairs + seed - 1)];
        if (!runs_.failed(key)) columns.col(k) += (site.bins(corrected(key)) - before) / (step * kPairs);
      }
    }
  }
  return columns;
}

void Chain::computeSignatures(const std::vector<const Variant*>& variants, const std::string& what) {
  for (const Variant* v : variants) {
    for (const Site& site : sites_) requestSignature(site, *v);
  }
  runs_.makeMissing(what);
  for (const Variant* v : variants) {
    Eigen::MatrixXd columns(data_.size(), static_cast<Eigen::Index>(v->amplitudes.size()));
    for (const Site& site : sites_) columns.middleRows(site.first_row, site.rows()) = signature(site, *v);
    signatures_[v] = columns;
  }
}

LinearModel Chain::linearModel(const Model& model) const {
  LinearModel m;
  m.offset = model.offset;
  const Eigen::Index own = unknowns(), count = own + model.effect_columns.cols();
  m.columns.resize(data_.size(), count);
  m.columns << baseline_columns_, model.effect_columns;
  m.prior_mean = Eigen::VectorXd::Zero(count);
  m.prior_sigma.resize(count);
  m.positive.assign(static_cast<std::size_t>(count), false);
  for (std::size_t k = 0; k < ice_.size(); ++k) m.prior_sigma[static_cast<Eigen::Index>(k)] = ice_[k].sigma;
  for (std::size_t i = 0; i < records_; ++i) {
    m.prior_sigma[sites_[i].own()] = kGapSigmaM;
    m.prior_sigma[sites_[i].own() + 1] = sites_[i].observation().clock_sigma_s;
  }
  Eigen::Index column = own;
  for (const Variant* v : model.variants) {
    for (const Amplitude& a : v->amplitudes) {
      m.prior_mean[column] = a.prior_mean;
      m.prior_sigma[column] = a.prior_sigma;
      m.positive[static_cast<std::size_t>(column)] = a.positive;
      ++column;
    }
  }
  return m;
}

/// Covariance of what the law of a model's effects may be off at these amplitudes.
/// A load cell's bias or scale has no other law: with that freedom, a little of it would explain anything smooth.
Eigen::MatrixXd Chain::formErrors(const Model& model, const Eigen::VectorXd& amplitudes) const {
  Eigen::VectorXd change = Eigen::VectorXd::Zero(data_.size());
  Eigen::Index column = 0;
  for (const Variant* v : model.variants) {
    const auto count = static_cast<Eigen::Index>(v->amplitudes.size());
    if (!v->effect->reading_only) {
      change += model.effect_columns.middleCols(column, count) * amplitudes.segment(column, count);
    }
    column += count;
  }
  Eigen::MatrixXd form = Eigen::MatrixXd::Zero(data_.size(), data_.size());
  for (const Site& site : sites_) {
    if (!site.observation().ice_contact) continue;
    form.block(site.first_row, site.first_row, site.rows(), site.rows()) =
        computeFormCovariance(discrepancy_, site.observation(), change.segment(site.first_row, site.rows()));
  }
  return form;
}

/// How far an effect's law may be off depends on how much of it there is. That is integrated over one amplitude; with
/// several, they are fitted twice.
void Chain::refit(Model& model) const {
  const LinearModel m = linearModel(model);
  const Eigen::Index amplitudes = model.effect_columns.cols();
  if (amplitudes == 1 && !model.variants[0]->effect->reading_only) {
    const Eigen::MatrixXd form = formErrors(model, Eigen::VectorXd::Ones(1));
    model.fit = fitWithForm(data_, m, errors_, unknowns(), form, model.density);
    return;
  }
  if (amplitudes == 0 || model.fit.x.size() != m.columns.cols()) model.fit = fitLinear(data_, m, errors_);
  if (amplitudes == 0) return;
  ErrorModel errors = errors_;
  errors.noise += formErrors(model, model.fit.x.tail(amplitudes));
  model.fit = fitLinear(data_, m, errors);
}

Model Chain::linear(const std::vector<const Variant*>& variants) const {
  Model model;
  model.variants = variants;
  model.offset = baseline_offset_;
  Eigen::Index count = 0;
  for (const Variant* v : variants) count += signatures_.at(v).cols();
  model.effect_columns.resize(data_.size(), count);
  count = 0;
  for (const Variant* v : variants) {
    const Eigen::MatrixXd& columns = signatures_.at(v);
    model.effect_columns.middleCols(count, columns.cols()) = columns;
    count += columns.cols();
    const auto located = located_log_odds_.find(v);
    if (located != located_log_odds_.end()) model.shape_log_odds += located->second;
  }
  refit(model);
  return model;
}

/// Looks for causes of one kind that may be at many places: one after the other, each where it explains most, at most
/// three, as long as each earns its place.
/// @param places     at which one may be
/// @param prior      of each column's unknown
/// @param columns    what it does to the force of the first record from a place, per unit
/// @param found      out
/// @param log_odds   out: what having looked at many places costs
/// @return ln of the Bayes factor of all of them together
double Chain::findPlaces(const Model& start, const std::vector<double>& places, const Amplitude& prior,
                         const std::function<Eigen::MatrixXd(double)>& columns, std::vector<double>& found,
                         double& log_odds) const {
  constexpr double kGain = 2.0;
  const Site& site = sites_.front();
  found.clear();
  log_odds = 0.0;
  double total = 0.0;
  if (places.empty()) return total;
  LinearModel model = linearModel(start);
  // At the start's kappa: a trial moves it only a little.
  const FactoredErrors errors(errors_, start.fit.kappa);
  double before = computeLogEvidence(data_, model, errors);
  const Eigen::Index added = columns(places.front()).cols();
  while (found.size() < 3) {
    std::vector<double> gains;
    LinearModel trial = model;
    const Eigen::Index column = model.columns.cols();
    trial.columns.conservativeResize(Eigen::NoChange, column + added);
    trial.prior_mean.conservativeResize(column + added);
    trial.prior_sigma.conservativeResize(column + added);
    trial.prior_mean.tail(added).setConstant(prior.prior_mean);
    trial.prior_sigma.tail(added).setConstant(prior.prior_sigma);
    trial.positive.resize(static_cast<std::size_t>(column + added), prior.positive);
    LinearModel best = trial;
    double best_evidence = -std::numeric_limits<double>::infinity();
    for (const double place : places) {
      trial.columns.rightCols(added).setZero();
      trial.columns.block(site.first_row, column, site.rows(), added) = columns(place);
      const double evidence = computeLogEvidence(data_, trial, errors);
      gains.push_back(evidence - before);
      if (evidence > best_evidence) {
        best_evidence = evidence;
        best = trial;
      }
    }
    const double mean_gain = logMeanExp(gains);
    const auto top = static_cast<std::size_t>(std::max_element(gains.begin(), gains.end()) - gains.begin());
    if (mean_gain < kGain && !found.empty()) return total;
    found.push_back(places[top]);
    total += mean_gain;
    log_odds += mean_gain - gains[top];
    before = best_evidence;
    model = best;
    if (mean_gain < kGain) return total;
  }
  return total;
}

/// Adds falls and swell where the record suggests them, beside what a model has already.
void Chain::locate(const Model& start, const std::string& what) {
  if (!sites_.front().observation().ice_contact) return;
  std::vector<const Variant*> added;
  std::vector<double> places;
  double log_odds = 0.0;
  const bool falls = !EffectsConfig(sites_.front().scenario.effects)["block_drop"].enabled;
  const auto add = [&](Variant variant) {
    variants_.push_back(std::make_unique<Variant>(std::move(variant)));
    located_log_odds_[variants_.back().get()] = log_odds;
    added.push_back(variants_.back().get());
  };
  const Site& site = sites_.front();
  if (falls) {
    constexpr double kGridS = 0.5;
    std::vector<double> times;
    const double end = site.observation().time_s[site.rows() - 1];
    for (int k = 0; 1.0 + k * kGridS < end - 1.0; ++k) times.push_back(1.0 + k * kGridS);
    const auto columns = [&](double time) -> Eigen::MatrixXd { return fallTemplate(time, site.observation().time_s); };
    if (findPlaces(start, times, makeFalls({0.0}).amplitudes[0], columns, places, log_odds) > 0.0) {
      std::sort(places.begin(), places.end());
      add(makeFalls(places));
    }
  }
  if (swell_) {
    constexpr double kShortestS = 3.0, kLongestS = 14.0, kRatio = 1.06, kStepsPerS = 20.0;
    std::vector<double> periods;
    for (int k = 0;; ++k) {
      const double period = kShortestS * std::pow(kRatio, k);
      if (period >= kLongestS) break;
      periods.push_back(std::round(period * kStepsPerS) / kStepsPerS);
    }
    const Eigen::MatrixXd response = signatures_.at(swell_.get()).middleRows(site.first_row, site.rows());
    const CollectorConfig& rig = site.scenario.collector;
    const Eigen::VectorXd mass_kg = site.mean_n.cwiseMax(0.0).array() / kGravityMps2 + rig.mass_kg + rig.pole_mass_kg;
    const auto columns = [&](double period) {
      return swellResponse(response, kSwellPeriodS, period, site.observation().time_s, mass_kg);
    };
    if (!response.isZero() &&
        findPlaces(start, periods, makeSwell({6.0}).amplitudes[0], columns, places, log_odds) > 0.0) {
      add(makeSwell(places));
    }
  }
  computeSignatures(added, what);
}

/// Within what can be simulated.
Eigen::VectorXd Chain::clipped(const Model& model, Eigen::VectorXd x) const {
  for (std::size_t k = 0; k < ice_.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    x[i] = std::clamp(ice_[k].prior + x[i], ice_[k].low, ice_[k].high) - ice_[k].prior;
  }
  for (std::size_t i = 0; i < records_; ++i) {
    x[sites_[i].own()] = std::max(x[sites_[i].own()], -sites_[i].scenario.procedure.start_gap_m);
  }
  Eigen::Index column = unknowns();
  for (const Variant* v : model.variants) {
    for (const Amplitude& a : v->amplitudes) {
      x[column] = std::clamp(x[column], a.least, a.most);
      ++column;
    }
  }
  return x;
}

/// The force of a model at x in all bins, mean over the pairs' seeds; none where the world freezes.
std::optional<Eigen::VectorXd> Chain::simulated(const Model& model, const Eigen::VectorXd& x, bool request_only) {
  std::vector<Eigen::VectorXd> parts;
  const bool sideways = std::any_of(model.variants.begin(), model.variants.end(),
                                    [](const Variant* v) { return v->effect->acts_sideways; });
  for (const Site& site : sites_) {
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(site.rows());
    const int seeds = site.direction_rad && !sideways ? 0 : site.observation().ice_contact ? kPairs : 1;
    const double delay = x[site.own() + 1];
    for (int seed = 1; seed <= seeds; ++seed) {
      const Scenario s = scenarioAt(site, x, model.variants, seed);
      try {
        s.validate();
      } catch (const ConfigError&) {
        return std::nullopt;
      }
      const std::string key = runs_.request(s);
      if (request_only) continue;
      if (runs_.failed(key)) return std::nullopt;
      mean += site.bins(asRead(corrected(key), s, x, model.variants), delay) / seeds;
    }
    parts.push_back(mean);
  }
  return stacked(parts);
}

/// Gauss-Newton with the slopes of the signatures: simulate where the fit is, and fit again around that.
void Chain::confirm(const std::vector<Model*>& models, const std::string& what) {
  for (Model* model : models) {
    if (model->frozen) continue;
    model->x = clipped(*model, model->fit.x);
    if (!simulated(*model, model->x, true)) model->frozen = true;
  }
  runs_.makeMissing(what);
  for (Model* model : models) {
    if (model->frozen) continue;
    const std::optional<Eigen::VectorXd> curve = simulated(*model, model->x, false);
    if (!curve) {
      model->frozen = true;
      continue;
    }
    model->simulated = true;
    model->curve_n = *curve;
    model->offset = *curve - linearModel(*model).columns * model->x;
    refit(*model);
  }
}

/// Central 95 % of an amplitude, over all shapes of the effect. What the simulation of the best shape changed of its
/// amplitude and evidence is taken to hold for the others.
std::pair<double, double> amplitudeInterval(const Model& model) {
  const Eigen::Index last = model.fit.x.size() - 1;
  const double shift = model.fit.x[last] - model.screened_fit.x[last];
  const double gain = model.fit.log_evidence - model.screened_fit.log_evidence;
  std::vector<UnknownDensity> all{model.density};
  for (const UnknownDensity& screened : model.other_shapes) {
    UnknownDensity moved;
    for (std::size_t i = 0; i < screened.value.size(); ++i) {
      const double value = screened.value[i] + shift;
      if (model.variants[0]->amplitudes[0].positive && value < 0.0) continue;
      moved.value.push_back(value);
      moved.log_density.push_back(screened.log_density[i] + gain);
    }
    if (moved.value.size() > 1) all.push_back(moved);
  }
  return {computeQuantile(all, 0.025), computeQuantile(all, 0.975)};
}

Explanation Chain::explain(const Model& model, const Model& baseline, const Detectability& detectability) const {
  Explanation e;
  e.holdout_rmse_n = e.holdout_ratio = kNaN;
  for (const Variant* v : model.variants) {
    e.effects.emplace_back(v->effect->name);
    e.shape += (e.shape.empty() ? "" : "; ") + v->label;
    e.threshold = std::max(e.threshold, thresholds_.of(v->effect->name));
  }
  e.confirmed = model.simulated;
  // The baseline's evidence has changed since those were screened that nobody simulated.
  e.log_bayes_factor = model.simulated ? score(model) - baseline.fit.log_evidence : model.screened;
  e.chi2_per_bin = chi2PerBin(model);
  // What moves the rig sideways shows in the lateral channels first.
  const bool sideways = std::any_of(model.variants.begin(), model.variants.end(),
                                    [](const Variant* v) { return v->effect->acts_sideways; });
  const Eigen::Index lateral_rows = data_.size() - record_rows_;
  const bool seen_sideways =
      sideways && baseline.fit.whitened.tail(lateral_rows).squaredNorm() > static_cast<double>(lateral_rows);
  const Eigen::Index rows = seen_sideways ? data_.size() : record_rows_;
  const double before = baseline.fit.whitened.head(rows).squaredNorm(), excess = before - static_cast<double>(rows);
  e.explained_ratio = excess > 0.0 ? (before - model.fit.whitened.head(rows).squaredNorm()) / excess : kNaN;
  e.portmanteau_p = computeLjungBox(whitened(model), kPortmanteauLags);
  const Eigen::VectorXd x = model.simulated ? model.x : model.fit.x;
  e.detectability = detectability.of(model.effect_columns * x.tail(model.effect_columns.cols()));
  const Eigen::VectorXd error = (data_ - (model.simulated ? model.curve_n : model.fit.mean)).head(record_rows_);
  e.rmse_n = std::sqrt(error.squaredNorm() / static_cast<double>(error.size()));
  Eigen::Index column = unknowns();
  for (const Variant* v : model.variants) {
    const auto count = static_cast<Eigen::Index>(v->amplitudes.size());
    for (const ParameterEstimate& p :
         v->estimate(x.segment(column, count), model.fit.covariance.block(column, column, count, count))) {
      e.parameters.push_back(p);
    }
    column += count;
  }
  if (model.variants.size() == 1 && !model.density.value.empty()) {
    ParameterEstimate& p = e.parameters.front();
    std::tie(p.low, p.high) = amplitudeInterval(model);
    if (x[unknowns()] < 0.0 && p.value > 0.0) {  // told by its size
      std::tie(p.low, p.high) = std::make_pair(std::max(-p.high, 0.0), -p.low);
    }
  }
  for (std::size_t k = 0; k < ice_.size(); ++k) {
    e.baseline.push_back(ice_[k].prior + x[static_cast<Eigen::Index>(k)]);
  }
  for (std::size_t i = 0; i < records_; ++i) {
    e.baseline.push_back(sites_[i].scenario.procedure.start_gap_m + x[sites_[i].own()]);
    e.baseline.push_back(x[sites_[i].own() + 1]);
  }
  if (model.frozen) e.note = "the simulation with it freezes or is refused: it could not be confirmed";
  return e;
}

/// Tries what is left beside the best explanation, and keeps a pair that is so much better that chance is no excuse.
void Chain::addSecondEffect(std::vector<Model>& models, const Model& baseline) {
  if (models.empty()) return;
  const Model first = models.front();
  const double gained = score(first) - baseline.fit.log_evidence;
  if (!first.simulated || gained < thresholds_.log_bayes_factor) return;
  const std::string first_name = first.variants[0]->effect->name;
  locate(first, "falls and swell beside " + first_name);
  std::optional<Model> best;
  for (const auto& v : variants_) {
    if (v->effect->name == first_name || signatures_.count(v.get()) == 0) continue;
    Model pair = first;
    pair.variants.push_back(v.get());
    const Eigen::MatrixXd& columns = signatures_.at(v.get());
    pair.effect_columns.conservativeResize(Eigen::NoChange, pair.effect_columns.cols() + columns.cols());
    pair.effect_columns.rightCols(columns.cols()) = columns;
    const auto located = located_log_odds_.find(v.get());
    if (located != located_log_odds_.end()) pair.shape_log_odds += located->second;
    pair.simulated = false;
    refit(pair);
    if (!best || score(pair) > score(*best)) best = pair;
  }
  if (!best || score(*best) - score(first) <
                   std::max(thresholds_.second_effect, thresholds_.of(best->variants[1]->effect->name)))
    return;
  for (int pass = 0; pass < kPasses; ++pass) confirm({&*best}, "two effects");
  if (best->simulated && score(*best) - score(first) > thresholds_.second_effect) models.insert(models.begin(), *best);
}

/// The delay within 1.5 s with which a curve fits a record best; a delay of 0.5 s costs what one standard deviation
/// costs.
double bestDelay(const Site& site, const std::vector<SimulatedForce>& forces) {
  constexpr double kSigmaS = 0.5, kMostS = 1.5;
  const Eigen::VectorXd& record = site.observation().force_n;
  const double scale = 0.05 * record.cwiseAbs().maxCoeff();
  double best_delay = 0.0, best_cost = std::numeric_limits<double>::infinity();
  constexpr int kSteps = 30;
  for (int step = -kSteps; step <= kSteps; ++step) {
    const double delay = kMostS * step / kSteps;
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(site.rows());
    for (const SimulatedForce& force : forces) mean += site.bins(force, delay) / static_cast<double>(forces.size());
    const double cost = (record - mean).squaredNorm() / (scale * scale) * 0.1 + delay * delay / (kSigmaS * kSigmaS);
    if (cost < best_cost) {
      best_cost = cost;
      best_delay = delay;
    }
  }
  return best_delay;
}

/// Predicts a record that was not fitted. Only its own delay is fitted, for every model alike: when the rim meets the
/// ice is a matter of the spot.
void Chain::evaluateHoldout(const Model& baseline, const std::vector<Model>& models, Identification& result) {
  Site site = makeSite(*input_.holdout);
  Model given;
  given.x = Eigen::VectorXd::Zero(unknowns());
  given.simulated = true;
  const auto forcesOf = [&](const Model& model, bool request_only) {
    std::vector<SimulatedForce> forces;
    for (int seed = 1; seed <= kPairs; ++seed) {
      const Scenario s = scenarioAt(site, model.x, model.variants, seed);
      const std::string key = runs_.request(s);
      if (request_only || runs_.failed(key)) continue;
      forces.push_back(&model == &given ? runs_.force(key) : asRead(corrected(key), s, model.x, model.variants));
    }
    return forces;
  };
  std::vector<const Model*> all{&given, &baseline};
  // What the evidence speaks against needs no prediction.
  for (std::size_t k = 0; k < models.size(); ++k) {
    if (models[k].simulated && result.ranking[k].log_bayes_factor > 0.0) all.push_back(&models[k]);
  }
  for (const Model* model : all) forcesOf(*model, true);
  runs_.makeMissing("held-out record");
  std::map<const Model*, Eigen::VectorXd> curves;
  for (const Model* model : all) {
    const std::vector<SimulatedForce> forces = forcesOf(*model, false);
    if (forces.empty()) continue;
    const double delay = bestDelay(site, forces);
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(site.rows());
    for (const SimulatedForce& force : forces) mean += site.bins(force, delay) / static_cast<double>(forces.size());
    curves[model] = mean;
  }
  if (curves.count(&given) == 0 || curves.count(&baseline) == 0) return;
  site.mean_n = curves[&given];
  site.chaos_n = Eigen::VectorXd::Zero(site.rows());
  site.known_share = Eigen::VectorXd::Zero(site.rows());
  Eigen::MatrixXd covariance = computeNoiseCovariance(site.observation().noise, site.observation().time_s);
  if (site.observation().ice_contact) {
    site.known_share = computeKnownShare(discrepancy_, site.observation().time_s, site.observation().way_m);
    const double level = computeLevel(site.uncorrected(curves[&baseline]));
    covariance += ice_factor_ *
                  computeDiscrepancyCovariance(discrepancy_, site.observation(), site.scaledTo(level), site.chaos_n);
  }
  const auto errorOf = [&](const Model* model) {
    return curves.count(model) == 0 ? CurveError() : computeError(site.observation(), curves[model], covariance);
  };
  const CurveError without = errorOf(&baseline);
  predicted_.resize(models.size());
  for (std::size_t k = 0; k < models.size(); ++k) {
    if (curves.count(&models[k]) == 0) continue;
    predicted_[k] = {curves[&models[k]], errorOf(&models[k])};
    Explanation& e = result.ranking[k];
    e.holdout_rmse_n = predicted_[k].error.rmse_n;
    e.holdout_ratio = e.holdout_rmse_n / without.rmse_n;
  }
  RecordCurves& c = site.curves;
  c.baseline_n = curves[&given];
  c.before = errorOf(&given);
  c.refitted_n = curves[&baseline];
  c.refitted = without;
  c.total_sigma_n = covariance.diagonal().cwiseSqrt();
  result.holdout.push_back(c);
}

void Chain::addDetectable(Identification& result, const Detectability& detectability) const {
  struct Seen {
    const EffectDescription* effect;
    Eigen::VectorXd change;
  };
  std::vector<Seen> seen;
  std::set<std::string> told;
  const auto add = [&](const EffectDescription& effect, const Amplitude& amplitude, const Eigen::VectorXd& column) {
    const double per_unit = detectability.of(column);
    DetectableMagnitude m;
    m.effect = effect.name;
    for (const EffectParameter& p : effect.parameters) {
      const std::string name = p.name;
      if (amplitude.name.compare(0, name.size(), name) == 0)
        m.unit = p.unit, m.key = "effects." + m.effect + "." + name;
    }
    m.value = per_unit > 0.0 ? thresholds_.detectability / per_unit : kNaN;
    m.expected_detectability = per_unit * std::max(amplitude.prior_sigma, std::abs(amplitude.prior_mean));
    if (told.insert(m.key).second) {
      result.minimum_detectable.push_back(m);
      if (m.expected_detectability > 1.0) seen.push_back({&effect, column});
    }
  };
  // The middle of the shapes of each effect; falls and swell at a place of their own.
  for (const EffectDescription& effect : effectRegistry()) {
    const std::string name = effect.name;
    const Site& site = sites_.front();
    if (name == "block_drop" && site.observation().ice_contact) {
      Eigen::VectorXd column = Eigen::VectorXd::Zero(data_.size());
      const double late = 0.6 * site.observation().time_s[site.rows() - 1];
      column.segment(site.first_row, site.rows()) = fallTemplate(late, site.observation().time_s);
      add(effect, makeFalls({late}).amplitudes[0], column);
      continue;
    }
    if (name == "vessel_heave" && swell_) {
      add(effect, swell_->amplitudes[0], signatures_.at(swell_.get()).col(0));
      continue;
    }
    std::vector<const Variant*> own;
    for (const auto& v : variants_) {
      if (v->effect == &effect && signatures_.count(v.get()) > 0) own.push_back(v.get());
    }
    if (own.empty()) continue;
    std::set<std::string> done;
    const Variant* middle = own[own.size() / 2];
    own.insert(own.begin(), middle);
    for (const Variant* v : own) {
      for (std::size_t k = 0; k < v->amplitudes.size(); ++k) {
        if (done.insert(v->amplitudes[k].name).second) {
          add(effect, v->amplitudes[k], signatures_.at(v).col(static_cast<Eigen::Index>(k)));
        }
      }
    }
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (seen[i].effect == seen[j].effect) continue;
      const double r = std::abs(detectability.correlation(seen[i].change, seen[j].change));
      if (r < thresholds_.rival_correlation) continue;
      result.confusable.push_back({{seen[j].effect->name, seen[i].effect->name},
                                   r,
                                   std::string(seen[j].effect->name) + ": " + seen[j].effect->how_to_tell + "; " +
                                       seen[i].effect->name + ": " + seen[i].effect->how_to_tell});
    }
  }
}

std::optional<ReferenceLift> Chain::reference(bool simulate) {
  baseline_only_ = true;
  sites_.push_back(makeSite(input_.records.front()));
  records_ = 1;
  ice_ = iceUnknowns(sites_.front().curves.record);
  simulateBaseline();
  const Site& site = sites_.front();
  if (!site.observation().ice_contact) return {};
  Model baseline = linear({});
  if (simulate) {
    confirm({&baseline}, "reference " + site.curves.path);
    setErrors(baseline.simulated ? baseline.curve_n : baseline.fit.mean, clipped(baseline, baseline.fit.x));
    refit(baseline);
  }
  ReferenceLift lift;
  const Eigen::VectorXd simulated_n = site.uncorrected(baseline.fit.mean), left = data_ - simulated_n;
  const double level = computeLevel(simulated_n);
  const Eigen::Index at_rest = (site.observation().time_s.array() <= 0.0).count();
  if (at_rest > 0) lift.rest_share = left.head(at_rest).mean() / level;
  for (Eigen::Index i = at_rest; i < site.rows(); ++i) {
    lift.way_m.push_back(site.observation().way_m[i]);
    lift.residual_share.push_back(left[i] / level);
  }
  lift.turn_way_m = findTurns(site.observation().path);
  const Eigen::VectorXd x = clipped(baseline, baseline.fit.x);
  for (Eigen::Index k = 0; k < kIceUnknowns; ++k) lift.ice[k] = ice_[static_cast<std::size_t>(k)].prior + x[k];
  return lift;
}

Identification Chain::run() {
  Identification result;
  for (const NamedRecord& record : input_.records) {
    sites_.push_back(makeSite(record));
    sites_.back().record = records_++;
  }
  addLateralSites();
  ice_ = iceUnknowns(sites_.front().curves.record);
  simulateBaseline();
  {
    std::vector<const Variant*> all;
    for (const auto& v : variants_) all.push_back(v.get());
    if (swell_) all.push_back(swell_.get());
    computeSignatures(all, "what effects do");
  }
  // Slopes are rough: the baseline is simulated where they lead before anything else is fitted around it.
  Model baseline = linear({});
  confirm({&baseline}, "baseline refitted");
  if (baseline.frozen) throw ConfigError("", "", "the simulation of the refitted ice freezes", input_.records[0].path);
  baseline_offset_ = baseline.offset;
  setErrors(baseline.curve_n, baseline.x);
  refit(baseline);
  if (!input_.screen_only) locate(baseline, "falls and swell");

  // Each effect in its best shape; what the other shapes say of it counts as well.
  std::vector<Model> models;
  for (const EffectDescription& effect : effectRegistry()) {
    std::vector<double> evidence;
    std::vector<Model> shapes;
    for (const auto& v : variants_) {
      if (v->effect != &effect) continue;
      shapes.push_back(linear({v.get()}));
      evidence.push_back(shapes.back().fit.log_evidence);
    }
    if (shapes.empty()) continue;
    const auto best = shapes.begin() + (std::max_element(evidence.begin(), evidence.end()) - evidence.begin());
    for (auto other = shapes.begin(); other != shapes.end(); ++other) {
      const bool same_unknown = other->variants[0]->amplitudes[0].name == best->variants[0]->amplitudes[0].name;
      if (other != best && same_unknown && !other->density.value.empty()) best->other_shapes.push_back(other->density);
    }
    best->shape_log_odds += logMeanExp(evidence) - best->fit.log_evidence;
    best->screened = score(*best) - baseline.fit.log_evidence;
    best->screened_fit = best->fit;
    models.push_back(*best);
  }
  const auto byScore = [](const Model& a, const Model& b) { return score(a) > score(b); };
  std::stable_sort(models.begin(), models.end(), byScore);
  std::vector<Model*> to_confirm{&baseline};
  for (std::size_t k = 0; k < models.size() && k < kConfirmed; ++k) to_confirm.push_back(&models[k]);
  const auto isHopeless = [&](const Model* m) {
    return m != &baseline && score(*m) - baseline.fit.log_evidence <= kWorthSimulating;
  };
  for (int pass = 0; pass < kPasses && !input_.screen_only; ++pass) {
    to_confirm.erase(std::remove_if(to_confirm.begin(), to_confirm.end(), isHopeless), to_confirm.end());
    if (to_confirm.size() == 1) break;
    confirm(to_confirm, "full simulations of the best explanations");
  }
  // A simulation counts for more than a straight line.
  std::stable_sort(models.begin(), models.end(), [](const Model& a, const Model& b) {
    return a.simulated != b.simulated ? a.simulated : score(a) > score(b);
  });
  addSecondEffect(models, baseline);

  const Detectability detectability(linearModel(baseline), errors_, baseline.fit.kappa);
  for (const Model& model : models) result.ranking.push_back(explain(model, baseline, detectability));
  addDetectable(result, detectability);
  if (input_.holdout && !input_.screen_only) evaluateHoldout(baseline, models, result);
  result.bins = static_cast<std::size_t>(record_rows_);
  result.chi2_per_bin = chi2PerBin(baseline);
  result.portmanteau_p = computeLjungBox(whitened(baseline), kPortmanteauLags);
  result.kappa = baseline.fit.kappa;
  result.ice_factor = ice_factor_;
  decide(result, sites_.front().curves.report, thresholds_);

  // The curves, for the explanation that was accepted.
  const Model* best = result.accepted ? &models[*result.accepted] : nullptr;
  for (std::size_t k = 0; k < ice_.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    result.baseline.push_back({ice_[k].key, ice_[k].unit, ice_[k].prior, ice_[k].sigma, ice_[k].prior + baseline.x[i],
                               std::sqrt(baseline.fit.covariance(i, i))});
  }
  for (std::size_t i = 0; i < records_; ++i) {
    const Eigen::Index own = sites_[i].own();
    const std::string of = records_ > 1 ? " of record " + std::to_string(i + 1) : "";
    const double gap = sites_[i].scenario.procedure.start_gap_m;
    result.baseline.push_back({"procedure.start_gap_m" + of, "m", gap, kGapSigmaM, gap + baseline.x[own],
                               std::sqrt(baseline.fit.covariance(own, own))});
    result.baseline.push_back({"clock of the force" + of, "s", 0.0, sites_[i].observation().clock_sigma_s,
                               baseline.x[own + 1], std::sqrt(baseline.fit.covariance(own + 1, own + 1))});
    RecordCurves c = sites_[i].curves;
    const auto rows = [&](const Eigen::VectorXd& all) {
      return Eigen::VectorXd(all.segment(sites_[i].first_row, sites_[i].rows()));
    };
    const Eigen::MatrixXd covariance =
        (errors_.noise + errors_.discrepancy)
            .block(sites_[i].first_row, sites_[i].first_row, sites_[i].rows(), sites_[i].rows());
    c.baseline_n = sites_[i].mean_n;
    c.refitted_n = rows(baseline.curve_n);
    c.before = computeError(c.observation, c.baseline_n, covariance);
    c.refitted = computeError(c.observation, c.refitted_n, covariance);
    if (best != nullptr) {
      c.with_effect_n = rows(best->curve_n);
      c.after = computeError(c.observation, c.with_effect_n, covariance);
    }
    c.total_sigma_n = covariance.diagonal().cwiseSqrt();
    result.records.push_back(c);
  }
  result.whitened_before = whitened(baseline);
  result.autocorrelation_before = computeAutocorrelation(whitened(baseline), kPortmanteauLags);
  if (best != nullptr) {
    result.autocorrelation_after = computeAutocorrelation(whitened(*best), kPortmanteauLags);
    Scenario twin = scenarioAt(sites_.front(), best->x, best->variants, 1);
    Eigen::Index column = unknowns();
    for (const Variant* v : best->variants) {
      const auto count = static_cast<Eigen::Index>(v->amplitudes.size());
      if (v->effect->reading_only) v->apply(twin.effects[v->effect->name], best->x.segment(column, count));
      column += count;
    }
    result.overlay = toOverlay(twin);
  } else {
    result.overlay = toOverlay(scenarioAt(sites_.front(), baseline.x, {}, 1));
  }
  if (best != nullptr && !result.holdout.empty()) {
    result.holdout.front().with_effect_n = predicted_[*result.accepted].curve_n;
    result.holdout.front().after = predicted_[*result.accepted].error;
  }

  describe(result, thresholds_);
  return result;
}

}  // namespace

Identification identify(const IdentifyInput& input, RunLibrary& runs, const Thresholds& thresholds,
                        const Discrepancy& discrepancy) {
  const auto start = std::chrono::steady_clock::now();
  Identification result;
  result.discrepancy = discrepancy;
  if (!input.references.empty()) {
    // What is left depends on how much the fit allows for. It starts with little, so that the ice has to explain what
    // it can, and settles within a few passes; in the last, the refitted ice is simulated, as it will be for the
    // record.
    constexpr int kLearningPasses = 3;
    constexpr double kLittle = 0.03;
    result.discrepancy.share = kLittle;
    result.discrepancy.share_of_peak = 0.0;
    for (int pass = 0; pass < kLearningPasses; ++pass) {
      std::vector<ReferenceLift> lifts;
      for (const NamedRecord& record : input.references) {
        IdentifyInput reference;
        reference.records.push_back(record);
        const bool last = pass + 1 == kLearningPasses;
        if (auto lift = Chain(reference, runs, thresholds, result.discrepancy).reference(last)) lifts.push_back(*lift);
      }
      if (lifts.empty()) throw ConfigError("", "", "no reference shows ice", input.references.front().path);
      result.discrepancy = learnDiscrepancy(lifts, result.discrepancy);
    }
    result.discrepancy.share = discrepancy.share;
    result.discrepancy.share_of_peak = kReferenceFloor;
  }
  const Discrepancy learned = result.discrepancy;
  result = Chain(input, runs, thresholds, learned).run();
  result.discrepancy = learned;
  result.runs_needed = runs.requested();
  result.runs_made = runs.made();
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace brash_ice_rig
