#include "brash_ice_rig/identify/covariance.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/SVD>

#include "brash_ice_rig/config/broken_line.h"

namespace brash_ice_rig {

double computeMatern32(double distance, double length) {
  const double scaled = std::sqrt(3.0) * distance / length;
  return (1.0 + scaled) * std::exp(-scaled);
}

double computeLevel(const Eigen::VectorXd& force_n) {
  constexpr double kOverS = 8.0;
  const Eigen::Index count = std::min(static_cast<Eigen::Index>(kOverS / kBinS), force_n.size());
  assert(count > 0);
  double sum = force_n.head(count).sum(), largest = sum;
  for (Eigen::Index i = count; i < force_n.size(); ++i) {
    sum += force_n[i] - force_n[i - count];
    largest = std::max(largest, sum);
  }
  return largest / static_cast<double>(count);
}

namespace {

/// Cells of the way in which references are compared; procedures are the same if all corners lie as near as that.
constexpr double kGridM = 0.04;
/// What rearranges while the hoist stands does so ever more slowly: a rest is unrolled by the logarithm of its time.
/// The first quarter of a second is a cell, as is the last fifth of ten.
constexpr double kRestM = 0.16, kRestS = 1.0;

/// Corners of a path at which the speed changes by more than half. Before the first, the hoist stood.
std::vector<std::size_t> turnsOf(const HoistPath& path) {
  std::vector<std::size_t> turns;
  double before = 0.0;
  for (std::size_t k = 0; k + 1 < path.time_s.size(); ++k) {
    const double after = (path.height_m[k + 1] - path.height_m[k]) / (path.time_s[k + 1] - path.time_s[k]);
    if (std::abs(after - before) >= 0.5 * std::max(std::abs(after), std::abs(before))) {
      turns.push_back(k);
    }
    before = after;
  }
  return turns;
}

/// 1 up, -1 down, 0 at rest.
int directionOf(const HoistStage& stage) {
  const double way_m = stage.end_m - stage.start_m;
  return std::abs(way_m) < 0.5 * kGridM ? 0 : way_m > 0.0 ? 1 : -1;
}

double unrolledRest(double rested_s) {
  return kRestM * std::log1p(rested_s / kRestS);
}

/// Place at which each stage begins, with a cell of its own.
std::vector<double> startPlaces(const std::vector<HoistStage>& procedure) {
  std::vector<double> places{0.0};
  for (const HoistStage& stage : procedure) {
    const double length_m =
        directionOf(stage) == 0 ? unrolledRest(stage.duration_s) : std::abs(stage.end_m - stage.start_m);
    places.push_back(kGridM * std::ceil((places.back() + length_m) / kGridM - 1e-9));
  }
  places.pop_back();
  return places;
}

/// Place at which a procedure comes by a way for the first time.
double firstPlace(const std::vector<HoistStage>& procedure, const std::vector<double>& start_places, double way_m) {
  double place = way_m;
  for (std::size_t k = 0; k < procedure.size(); ++k) {
    if (directionOf(procedure[k]) != 1) continue;
    place = start_places[k] + way_m - procedure[k].start_m;
    if (way_m <= procedure[k].end_m) break;
  }
  return place;
}

}  // namespace

std::vector<HoistStage> stagesOf(const HoistPath& path) {
  std::vector<HoistStage> stages;
  for (const std::size_t k : turnsOf(path)) {
    if (!stages.empty()) {
      stages.back().end_m = path.height_m[k];
      stages.back().duration_s = path.time_s[k] - stages.back().start_s;
    }
    stages.push_back({path.time_s[k], path.time_s.back() - path.time_s[k], path.height_m[k], path.height_m.back()});
  }
  if (!stages.empty() && directionOf(stages.back()) == 0) stages.pop_back();
  return stages;
}

bool isSameProcedure(const std::vector<HoistStage>& a, const std::vector<HoistStage>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const HoistStage& one, const HoistStage& other) {
    return std::abs(one.start_m - other.start_m) < kGridM && directionOf(one) == directionOf(other);
  });
}

Eigen::VectorXd unrollWay(const std::vector<HoistStage>& procedure, const HoistPath& path,
                          const Eigen::VectorXd& time_s, const Eigen::VectorXd& way_m) {
  assert(time_s.size() == way_m.size());
  if (procedure.empty()) return way_m;
  const std::vector<HoistStage> own = stagesOf(path);
  const std::vector<double> start_places = startPlaces(procedure);
  Eigen::VectorXd unrolled(way_m.size());
  if (!isSameProcedure(own, procedure)) {
    for (Eigen::Index i = 0; i < way_m.size(); ++i) unrolled[i] = firstPlace(procedure, start_places, way_m[i]);
    return unrolled;
  }
  for (Eigen::Index i = 0; i < way_m.size(); ++i) {
    std::size_t k = 0;
    while (k + 1 < own.size() && own[k + 1].start_s <= time_s[i]) ++k;
    const int direction = directionOf(own[k]);
    const double rested_s = std::clamp(time_s[i] - own[k].start_s, 0.0, procedure[k].duration_s);
    unrolled[i] = start_places[k] + (direction == 0 ? unrolledRest(rested_s) : direction * (way_m[i] - own[k].start_m));
  }
  return unrolled;
}

Eigen::VectorXd computeKnownShare(const Discrepancy& d, const HoistPath& path, const Eigen::VectorXd& time_s,
                                  const Eigen::VectorXd& way_m) {
  assert(time_s.size() == way_m.size());
  Eigen::VectorXd share = Eigen::VectorXd::Zero(time_s.size());
  if (!d.fromReferences()) return share;
  const Eigen::VectorXd place_m = unrollWay(d.procedure, path, time_s, way_m);
  for (Eigen::Index i = 0; i < share.size(); ++i) {
    if (time_s[i] > 0.0) share[i] = valueOfBrokenLine(d.way_m, d.mean_share, place_m[i]);
  }
  return share;
}

SimulatedForce correctKnownDiscrepancy(const Discrepancy& d, const HoistPath& path, SimulatedForce force) {
  if (!d.fromReferences()) return force;
  const auto count = static_cast<Eigen::Index>(force.time_s.size());
  const Eigen::VectorXd share =
      computeKnownShare(d, path, Eigen::Map<const Eigen::VectorXd>(force.time_s.data(), count),
                        Eigen::Map<const Eigen::VectorXd>(force.way_m.data(), count));
  const auto bin_count = std::max<Eigen::Index>(static_cast<Eigen::Index>(force.time_s.back() / kBinS), 1);
  const Eigen::VectorXd bins =
      (Eigen::VectorXd::LinSpaced(bin_count, 0.0, static_cast<double>(bin_count - 1)).array() + 0.5) * kBinS;
  const double level = computeLevel(binned(force.time_s, force.force_n, bins));
  Eigen::Map<Eigen::VectorXd>(force.force_n.data(), count) += level * share;
  return force;
}

double computeIceFactor(const Discrepancy& d, const IceValues& ice, const IceValues& sigma) {
  if (d.ice.empty()) return 1.0;
  IceValues mean = IceValues::Zero();
  for (const IceValues& reference : d.ice) mean += reference / static_cast<double>(d.ice.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Identity();
  for (const IceValues& reference : d.ice) {
    const IceValues off = (reference - mean).cwiseQuotient(sigma);
    spread += off * off.transpose();
  }
  const IceValues off = (ice - mean).cwiseQuotient(sigma);
  return 1.0 + off.dot(spread.llt().solve(off));
}

namespace {

/// The strongest directions of centred curves, one per column; a curve is a row.
Eigen::MatrixXd findModes(const Eigen::MatrixXd& centred, Eigen::Index count) {
  return Eigen::JacobiSVD<Eigen::MatrixXd>(centred, Eigen::ComputeThinV).matrixV().leftCols(count);
}

/// Length at which Matérn's correlation has this value at this distance, within what the cells can show, m.
double findLength(double correlation, double distance_m) {
  double low = kGridM, high = 0.5;
  for (int k = 0; k < 40; ++k) {
    const double middle = 0.5 * (low + high);
    (computeMatern32(distance_m, middle) < correlation ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

std::vector<double> findTurns(const HoistPath& path) {
  std::vector<double> ways;
  for (const std::size_t corner : turnsOf(path)) ways.push_back(path.height_m[corner]);
  return ways;
}

namespace {

bool holds(const std::vector<double>& ways, double way) {
  return std::any_of(ways.begin(), ways.end(), [&](double other) { return std::abs(other - way) < kGridM; });
}

}  // namespace

Discrepancy learnDiscrepancy(const std::vector<ReferenceLift>& lifts, const Discrepancy& before) {
  assert(!lifts.empty());
  Discrepancy learned = before;
  learned.way_m.clear();
  learned.mean_share.clear();
  learned.sigma_share.clear();
  learned.modes_share.clear();
  learned.turn_way_m.clear();
  learned.ice.clear();
  learned.known_rest_share.reset();
  for (const ReferenceLift& lift : lifts) learned.ice.push_back(lift.ice);

  learned.procedure = stagesOf(lifts.front().path);
  for (const ReferenceLift& lift : lifts) {
    const std::vector<HoistStage> stages = stagesOf(lift.path);
    if (!isSameProcedure(stages, learned.procedure)) learned.procedure.clear();
    for (std::size_t k = 0; k < learned.procedure.size(); ++k) {
      learned.procedure[k].duration_s = std::min(learned.procedure[k].duration_s, stages[k].duration_s);
    }
  }

  // Means of each lift in each cell that all of them cover, and what is left in a cell.
  double covered = std::numeric_limits<double>::infinity();
  std::vector<Eigen::VectorXd> place_m;
  for (const ReferenceLift& lift : lifts) {
    const auto bins = static_cast<Eigen::Index>(lift.way_m.size());
    place_m.push_back(unrollWay(learned.procedure, lift.path,
                                Eigen::Map<const Eigen::VectorXd>(lift.time_s.data(), bins),
                                Eigen::Map<const Eigen::VectorXd>(lift.way_m.data(), bins)));
    covered = std::min(covered, place_m.back().maxCoeff());
  }
  const auto count = static_cast<Eigen::Index>(lifts.size());
  std::vector<Eigen::VectorXd> cells;
  double rough = 0.0, rough_count = 0.0;
  for (std::size_t cell = 0; static_cast<double>(cell) * kGridM <= covered; ++cell) {
    Eigen::VectorXd means(count);
    bool whole = true;
    for (Eigen::Index i = 0; i < count; ++i) {
      const ReferenceLift& lift = lifts[static_cast<std::size_t>(i)];
      const Eigen::VectorXd& place = place_m[static_cast<std::size_t>(i)];
      double sum = 0.0, squares = 0.0, n = 0.0;
      for (std::size_t k = 0; k < lift.way_m.size(); ++k) {
        if (static_cast<std::size_t>(std::max(place[static_cast<Eigen::Index>(k)], 0.0) / kGridM) != cell) continue;
        sum += lift.residual_share[k];
        squares += lift.residual_share[k] * lift.residual_share[k];
        n += 1.0;
      }
      whole = whole && n > 0.0;
      if (n == 0.0) continue;
      means[i] = sum / n;
      rough += std::max(squares - sum * sum / n, 0.0);
      rough_count += n - 1.0;
    }
    if (!whole) continue;
    cells.push_back(means);
    learned.way_m.push_back((static_cast<double>(cell) + 0.5) * kGridM);
  }
  const auto places = static_cast<Eigen::Index>(cells.size());
  Eigen::MatrixXd curves(count, places);
  for (Eigen::Index p = 0; p < places; ++p) curves.col(p) = cells[static_cast<std::size_t>(p)];
  const Eigen::RowVectorXd mean = curves.colwise().mean();
  learned.mean_share.assign(mean.begin(), mean.end());
  if (count == 1) {
    learned.sigma_share.assign(cells.size(), before.share);
    return learned;
  }

  // Modes, with the uncertainty of the mean of n lifts.
  const double n = static_cast<double>(count);
  const Eigen::Index modes = std::min<Eigen::Index>(count / 3, 8);
  const Eigen::MatrixXd centred = curves.rowwise() - mean;
  const Eigen::MatrixXd directions = findModes(centred, modes);
  for (Eigen::Index k = 0; k < modes; ++k) {
    const double sigma = (centred * directions.col(k)).norm() / std::sqrt(n - 1.0) * std::sqrt(1.0 + 1.0 / n);
    const Eigen::VectorXd mode = directions.col(k) * sigma;
    learned.modes_share.emplace_back(mode.begin(), mode.end());
  }

  // What the others say of each lift is tested on it.
  Eigen::MatrixXd left(count, places);
  for (Eigen::Index i = 0; i < count; ++i) {
    Eigen::MatrixXd others(count - 1, places);
    others << curves.topRows(i), curves.bottomRows(count - 1 - i);
    const Eigen::RowVectorXd their_mean = others.colwise().mean();
    const Eigen::MatrixXd their_modes = findModes(others.rowwise() - their_mean, modes);
    const Eigen::VectorXd off = (curves.row(i) - their_mean).transpose();
    left.row(i) = off - their_modes * (their_modes.transpose() * off);
  }
  // Few lifts: the scatter over the neighbouring 0.2 m counts as well.
  const Eigen::RowVectorXd variance = left.colwise().squaredNorm() / n;
  for (Eigen::Index p = 0; p < places; ++p) {
    const Eigen::Index from = std::max<Eigen::Index>(p - 2, 0), to = std::min(p + 2, places - 1);
    learned.sigma_share.push_back(std::sqrt(variance.segment(from, to - from + 1).mean()));
  }
  constexpr Eigen::Index kLag = 2;
  if (places > kLag) {
    const Eigen::Index pairs = places - kLag;
    const double product = left.leftCols(pairs).cwiseProduct(left.rightCols(pairs)).sum();
    const double norms = left.leftCols(pairs).norm() * left.rightCols(pairs).norm();
    if (norms > 0.0) learned.length_m = findLength(product / norms, static_cast<double>(kLag) * kGridM);
  }
  if (rough_count > 0.0) learned.rough_share = std::sqrt(rough / rough_count);
  // What is expected without references counts as one of them.
  double squares = before.rest_share * before.rest_share, rests = 1.0;
  for (const ReferenceLift& lift : lifts) {
    if (!lift.rest_share) continue;
    squares += *lift.rest_share * *lift.rest_share;
    rests += 1.0;
  }
  if (rests > 2.0) learned.known_rest_share = std::sqrt(squares / rests);

  // Turns of the first lift that all lifts have.
  for (const double way : findTurns(lifts.front().path)) {
    const bool common = std::all_of(lifts.begin(), lifts.end(),
                                    [&](const ReferenceLift& lift) { return holds(findTurns(lift.path), way); });
    if (common) learned.turn_way_m.push_back(way);
  }
  return learned;
}

Eigen::MatrixXd computeNoiseCovariance(const ForceNoise& noise, const Eigen::VectorXd& time_s) {
  constexpr double kTimes[] = {0.5, 4.0, 30.0};
  const Eigen::Index n = time_s.size();
  const double part = noise.slow_n * noise.slow_n / 3.0;
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      double sum = i == j ? noise.white_n * noise.white_n : 0.0;
      for (const double time : kTimes) sum += part * std::exp(-std::abs(time_s[i] - time_s[j]) / time);
      covariance(i, j) = covariance(j, i) = sum;
    }
  }
  return covariance;
}

namespace {

/// Where on its way a lift is at each time, for how far what it is off at two of them is alike: distance covered, or
/// places as unrollWay() has them where references stop and turn alike; and time since the start in units of distance.
Eigen::VectorXd placesOf(const Discrepancy& d, const HoistPath& path, const Eigen::VectorXd& time_s,
                         const Eigen::VectorXd& travel_m, const Eigen::VectorXd& way_m) {
  // Places of a single stage are the distance covered.
  const bool unrolled = d.procedure.size() > 1 && isSameProcedure(stagesOf(path), d.procedure);
  const Eigen::VectorXd covered_m = unrolled ? unrollWay(d.procedure, path, time_s, way_m) : travel_m;
  return covered_m.array() + d.creep_mps * time_s.array().max(0.0);
}

Eigen::VectorXd placesOf(const Discrepancy& d, const Observation& o) {
  return placesOf(d, o.path, o.time_s, o.travel_m, o.way_m);
}

/// Place of each corner of the path.
Eigen::VectorXd cornerPlaces(const Discrepancy& d, const HoistPath& path) {
  const auto count = static_cast<Eigen::Index>(path.time_s.size());
  const std::vector<double> travel = computeTravel(path);
  const Eigen::Map<const Eigen::VectorXd> time_s(path.time_s.data(), count), travel_m(travel.data(), count),
      way_m(path.height_m.data(), count);
  return placesOf(d, path, time_s, travel_m, way_m);
}

}  // namespace

Eigen::MatrixXd computeFormCovariance(const Discrepancy& d, const Observation& o, const Eigen::VectorXd& change_n,
                                      double timing_sigma_s) {
  const Eigen::Index n = o.time_s.size();
  const Eigen::VectorXd place = placesOf(d, o), scaled_n = d.form_share * change_n;
  // What one standard deviation of time makes of it. A difference over both of them: where the change scatters with the
  // blocks, its slope is mostly scatter. Without references as much is allowed for anyway where the hoist starts and
  // where blocks rearrange.
  const double shift_s = d.fromReferences() ? timing_sigma_s : 0.0;
  const std::vector<double> time_s(o.time_s.begin(), o.time_s.end()), change(change_n.begin(), change_n.end());
  Eigen::VectorXd shifted_n(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    shifted_n[i] = 0.5 * (valueOfBrokenLine(time_s, change, o.time_s[i] + shift_s) -
                          valueOfBrokenLine(time_s, change, o.time_s[i] - shift_s));
  }
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      const double apart = std::abs(place[i] - place[j]);
      covariance(i, j) = covariance(j, i) = scaled_n[i] * scaled_n[j] * computeMatern32(apart, d.form_length_m) +
                                            shifted_n[i] * shifted_n[j] * computeMatern32(apart, d.timing_length_m);
    }
  }
  return covariance;
}

Eigen::MatrixXd computeDiscrepancyCovariance(const Discrepancy& d, const Observation& o,
                                             const Eigen::VectorXd& ice_force_n, const Eigen::VectorXd& chaos_n) {
  const Eigen::Index n = o.time_s.size();
  const double peak = ice_force_n.cwiseAbs().maxCoeff(), level = computeLevel(ice_force_n);
  const Eigen::VectorXd place = placesOf(d, o);
  Eigen::VectorXd smooth(n), rough(n), rest(n), turn = Eigen::VectorXd::Zero(n);
  const Eigen::VectorXd unrolled_m = unrollWay(d.procedure, o.path, o.time_s, o.way_m);
  for (Eigen::Index i = 0; i < n; ++i) {
    const bool moving = o.time_s[i] > 0.0;
    // References differ in the arrangement of their blocks, too.
    const double own = d.fromReferences() ? level * valueOfBrokenLine(d.way_m, d.sigma_share, unrolled_m[i])
                                          : std::hypot(d.share * ice_force_n[i], chaos_n[i]);
    smooth[i] = moving ? own + d.share_of_peak * peak : 0.0;
    rough[i] = moving ? d.rough_share * std::abs(ice_force_n[i]) : 0.0;
    const double at_rest =
        d.known_rest_share ? *d.known_rest_share * level : std::hypot(d.rest_share * peak, chaos_n[0]);
    rest[i] = at_rest * std::exp(-place[i] / d.rest_length_m);
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      const double apart = std::abs(place[i] - place[j]);
      covariance(i, j) = smooth[i] * smooth[j] * computeMatern32(apart, d.length_m) +
                         rough[i] * rough[j] * computeMatern32(apart, d.rough_length_m) + rest[i] * rest[j];
    }
  }
  for (const std::vector<double>& mode : d.modes_share) {
    Eigen::VectorXd curve = Eigen::VectorXd::Zero(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      if (o.time_s[i] > 0.0) curve[i] = level * valueOfBrokenLine(d.way_m, mode, unrolled_m[i]);
    }
    covariance.triangularView<Eigen::Lower>() += curve * curve.transpose();
  }
  const Eigen::VectorXd corners = cornerPlaces(d, o.path);
  // Each start, stop and turn has a term of its own, that fades with the distance or the time since.
  for (const std::size_t k : turnsOf(o.path)) {
    const bool known = holds(d.turn_way_m, o.path.height_m[k]);
    const double share = known ? d.known_turn_share : d.turn_share;
    const double length_m = known ? d.known_turn_length_m : d.turn_length_m;
    for (Eigen::Index i = 0; i < n; ++i) {
      const double since = place[i] - corners[static_cast<Eigen::Index>(k)];
      // The mean of a bin may begin before the corner that it holds.
      const bool after_corner = o.time_s[i] + 0.5 * kBinS > o.path.time_s[k];
      turn[i] = after_corner ? share * peak * std::exp(-std::max(since, 0.0) / length_m) : 0.0;
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j <= i; ++j) {
        covariance(i, j) += turn[i] * turn[j] * computeMatern32(std::abs(place[i] - place[j]), length_m);
      }
    }
  }
  return covariance.selfadjointView<Eigen::Lower>();
}

}  // namespace brash_ice_rig
