#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "brash_ice_rig/effects/effect.h"
#include "brash_ice_rig/identify/identification.h"

namespace brash_ice_rig {

// Arrangements of the blocks, seeds from 1 on: those from which the simulator's own scatter is known, and those on
// which differences are taken.
constexpr int kEnsemble = 6, kPairs = 2;
/// Of a lateral channel every so many bins count.
constexpr Eigen::Index kLateralThinning = 4;

// Unknowns of the baseline: those of the ice, which records share, then two for each record.
constexpr Eigen::Index kIceUnknowns = 3, kOwnUnknowns = 2;
/// Water between rim and ice at the start that nobody measured, m: as the mean of what is believed, and how far from
/// it. Without any, the rig would already carry ice at rest, and a cell that was zeroed there would seem to err.
constexpr double kGapM = 0.03, kGapSigmaM = 0.04;

/// What is fitted of the ice. Cohesion stands for its strength.
struct IceUnknown {
  const char *key, *unit;
  void (*set)(IceConfig& ice, double value);
  double prior, sigma, low, high;
};

std::vector<IceUnknown> iceUnknowns(const Record& record);

/// A record with what was found in it and how it is compared.
/// @throws ConfigError if nothing can be identified from it
RecordCurves readCurves(const NamedRecord& named);

/// So many references of one procedure are worth having on their own.
constexpr std::size_t kEnoughReferences = 6;

/// Which references teach what: those of a record's procedure where there are enough of them, all of them otherwise;
/// that group comes last.
/// @throws ConfigError if nothing can be identified from a record or a reference
std::vector<std::vector<NamedRecord>> groupReferences(const IdentifyInput& input);

/// One below the other.
Eigen::VectorXd stacked(const std::vector<Eigen::VectorXd>& parts);

/// One channel of a record, with its simulations.
struct Site {
  RecordCurves curves;
  std::size_t record = 0;               ///< whose own unknowns it has
  std::optional<double> direction_rad;  ///< of a lateral channel, from x towards y
  const Discrepancy* discrepancy = nullptr;
  Scenario scenario;                ///< of the baseline as given
  Eigen::VectorXd mean_n, chaos_n;  ///< of the baseline as given, as simulated
  Eigen::VectorXd known_share;      ///< what the simulator is known to be off, over the level of its force
  Eigen::VectorXd start_n;          ///< the baseline as given with that
  Eigen::MatrixXd slopes;           ///< a column per unknown of the baseline that this record has: ice, gap, clock
  Eigen::Index first_row = 0;

  const Observation& observation() const { return curves.observation; }
  /// Arrangements of the blocks from which its scatter is known.
  int seeds() const { return curves.observation.ice_contact ? kEnsemble : 1; }
  Eigen::Index rows() const { return curves.observation.time_s.size(); }
  /// Bins before the lift.
  Eigen::Index restRows() const { return (curves.observation.time_s.array() < 0.0).count(); }
  /// Rest before the lift for what acts at rest, s: all that the record shows, and before that what it takes to come
  /// up.
  double restBefore() const { return kFadeInS + std::ceil(std::max(-curves.observation.time_s[0], 0.0)); }
  /// Switches an effect on in a scenario of this record, with as much rest before the lift as it needs.
  void apply(const Variant& v, const Eigen::VectorXd& amplitudes, Scenario& s) const {
    v.apply(s.effects[v.effect->name], amplitudes);
    if (v.effect->acts_at_rest) s.procedure.rest_duration_s = restBefore();
  }
  Eigen::Index own() const { return kIceUnknowns + kOwnUnknowns * static_cast<Eigen::Index>(record); }
  Eigen::VectorXd bins(const SimulatedForce& f, double delay_s = 0.0) const {
    const Eigen::VectorXd& at = curves.observation.time_s;
    if (direction_rad) {
      return std::cos(*direction_rad) * binned(f.time_s, f.force_x_n, at, delay_s) +
             std::sin(*direction_rad) * binned(f.time_s, f.force_y_n, at, delay_s);
    }
    return binned(f.time_s, curves.observation.ice_contact ? f.force_n : f.empty_force_n, at, delay_s);
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

/// Whether one of its effects moves the rig sideways, so that the lateral channels see it.
inline bool actsSideways(const Model& m) {
  return std::any_of(m.variants.begin(), m.variants.end(), [](const Variant* v) { return v->effect->acts_sideways; });
}

inline bool hasEffect(const Model& m, const std::string& effect) {
  return std::any_of(m.variants.begin(), m.variants.end(), [&](const Variant* v) { return v->effect->name == effect; });
}

/// How far its effects' laws may be off in time, s.
inline double timingSigma(const Model& m) {
  double sigma_s = 0.0;
  for (const Variant* v : m.variants) sigma_s = std::max(sigma_s, v->effect->timing_sigma_s);
  return sigma_s;
}

/// ln of the evidence of an effect in its best shape, the choice of the shape counted.
inline double score(const Model& m) {
  return m.fit.log_evidence + m.shape_log_odds;
}

/// The steps from records to findings, in the order of doc/identification.md. Its files: chain_records.cpp has records,
/// baseline and errors, chain_effects.cpp what effects do, chain_fit.cpp the fits, chain_findings.cpp what follows from
/// them, chain_holdout.cpp the held-out record; identification.cpp puts them one after the other.
class Chain {
 public:
  /// @param discrepancies  at least one; a record goes with that of its procedure, or with the last
  Chain(const IdentifyInput& input, RunLibrary& runs, const Thresholds& thresholds,
        const std::vector<Discrepancy>& discrepancies)
      : input_(input), runs_(runs), thresholds_(thresholds), discrepancies_(discrepancies) {}

  Identification run();

  /// What is left of a lift without an effect after its baseline was refitted, and simulated there if asked. Nothing of
  /// one without ice.
  std::optional<ReferenceLift> reference(bool simulate);

 private:
  Site makeSite(const NamedRecord& named) const;
  Scenario scenarioAt(const Site& site, const Eigen::VectorXd& x, const std::vector<const Variant*>& variants,
                      int seed) const;
  Eigen::Index unknowns() const { return kIceUnknowns + kOwnUnknowns * static_cast<Eigen::Index>(records_); }
  SimulatedForce corrected(const Site& site, const std::string& key) const {
    return correctKnownDiscrepancy(*site.discrepancy, site.observation().path, runs_.force(key));
  }
  SimulatedForce asRead(SimulatedForce force, const Scenario& scenario, const Eigen::VectorXd& x,
                        const std::vector<const Variant*>& variants) const;
  void addLateralSites();
  Eigen::MatrixXd lateralDiscrepancy(const Site& site, const Site& vertical) const;
  std::vector<Site> lateralSites(const Site& vertical) const;
  /// An unknown of the baseline: its column in Site::slopes, its place in x, by how much it is moved.
  struct Slope {
    Eigen::Index column, unknown;
    double step;
  };
  std::vector<Slope> slopesOf(const Site& site) const;
  double iceFactor(const Site& site) const { return computeIceFactor(*site.discrepancy, ice_at_, ice_sigma_); }
  std::string requestBaseline(const Site& site, int seed, Eigen::Index unknown = -1, double step = 0.0);
  void simulateBaseline();
  void readBaseline(Site& site);
  Eigen::VectorXd baselineAsStated() const;
  void stackRecords();
  Eigen::MatrixXd discrepancyOf(const Site& site, const Eigen::VectorXd& curve_n) const;
  void setErrors(const Eigen::VectorXd& curve_n, const Eigen::VectorXd& x);
  void addVariants();
  void addTilts();
  std::vector<std::pair<const Variant*, std::size_t>> typicalAmplitudes(const EffectDescription& effect) const;
  /// Arrangements on which a variant's signature is taken.
  int pairsOf(const Variant& variant) const {
    return settled_.count(&variant) > 0 && !variant.effect->spares_ice ? kPairs : 1;
  }
  bool settle(std::vector<const Variant*> variants);
  void computeSignatures(const std::vector<const Variant*>& variants, const std::string& what);
  std::vector<std::string> requestSignature(const Site& site, const Variant& variant);
  Eigen::MatrixXd signature(const Site& site, const Variant& variant, const std::vector<std::string>& keys, int seed);
  std::vector<Eigen::MatrixXd> signaturesOf(const Variant& variant);
  LinearModel linearModel(const Model& model) const;
  Eigen::MatrixXd formErrors(const Model& model, const Eigen::VectorXd& amplitudes) const;
  void refit(Model& model) const;
  void addEffect(Model& model, const Variant& variant, const Eigen::MatrixXd& columns) const;
  Model linear(const Variant* variant) const;
  double findPlaces(const Model& start, const std::vector<double>& places, const Amplitude& prior,
                    const std::function<Eigen::MatrixXd(double)>& columns, std::vector<double>& found,
                    double& log_odds) const;
  std::vector<const Variant*> locateFalls(const Model& start);
  std::vector<const Variant*> locateSwell(const Model& start);
  std::vector<const Variant*> locateTilt(const Model& start);
  Eigen::MatrixXd sidewaysOnly(const Variant& leaning) const;
  const Variant* addLocated(Variant variant, double log_odds);
  void locate(const Model& start, const std::string& what);
  void confirm(const std::vector<Model*>& models, const std::string& what);
  void fitReading(Model& model);
  Eigen::VectorXd clipped(const Model& model, Eigen::VectorXd x) const;
  std::optional<Eigen::VectorXd> simulated(const Model& model, const Eigen::VectorXd& x, bool request_only);
  /// What is left of the records, lateral channels apart, in units of what is allowed.
  Eigen::VectorXd whitened(const Model& model) const { return model.fit.whitened.head(record_rows_); }
  double chi2PerBin(const Model& model) const {
    return whitened(model).squaredNorm() / static_cast<double>(record_rows_);
  }
  Eigen::VectorXd changeBy(const Model& model, const Eigen::VectorXd& x);
  Explanation explain(const Model& model, const Model& baseline, const Detectability& detectability);
  std::vector<Model> screenEffects(const Model& baseline);
  std::vector<Model> bestShapes(const std::map<const Variant*, Model>& screened, const Model& baseline) const;
  void startAsStated(Model& best, const Model& baseline);
  void startAgain(Model& baseline, const Model& best);
  void addSecondEffect(std::vector<Model>& models, const Model& baseline);
  ErrorModel heldOutErrors(std::vector<Site>& sites, const Eigen::VectorXd& without_n) const;
  void evaluateHoldout(const Model& baseline, const std::vector<Model>& models, Identification& result);
  void addCurves(const Model& baseline, const Model* best, Identification& result) const;
  void addDetectable(Identification& result, const Detectability& detectability);

  const IdentifyInput& input_;
  bool baseline_only_ = false;
  RunLibrary& runs_;
  const Thresholds& thresholds_;
  const std::vector<Discrepancy>& discrepancies_;
  std::vector<Site> sites_;  ///< records first, then the lateral channels of the first one
  std::size_t records_ = 0;
  std::optional<double> lateral_direction_deg_;  ///< where most of the lateral force is
  Eigen::Index record_rows_ = 0;                 ///< of the records, without lateral channels
  std::vector<IceUnknown> ice_;
  std::vector<std::unique_ptr<Variant>> variants_;
  std::vector<Variant> leaning_;    ///< ways of a leaning pole, where lateral channels would show them
  std::unique_ptr<Variant> swell_;  ///< of kSwellPeriodS, from which those of other periods follow
  std::map<const Variant*, Eigen::MatrixXd> signatures_;
  std::set<const Variant*> settled_;  ///< whose signature is taken on all pairs; one shows how likely a shape is
  std::map<const Variant*, double> located_log_odds_;  ///< for having looked at many times or ways
  Eigen::VectorXd data_;
  ErrorModel errors_;
  IceValues ice_at_, ice_sigma_;  ///< refitted ice for which they are, and what is believed of it
  Eigen::MatrixXd baseline_columns_;
  Eigen::VectorXd baseline_offset_;
  struct Predicted {
    Eigen::VectorXd curve_n;
    CurveError error;
  };
  std::vector<Predicted> predicted_;  ///< of the held-out record, in the order of the ranking; empty without a curve
};

}  // namespace brash_ice_rig
