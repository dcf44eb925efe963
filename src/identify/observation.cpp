#include "brash_ice_rig/identify/observation.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>

#include "brash_ice_rig/config/broken_line.h"
#include "brash_ice_rig/config/csv.h"
#include "brash_ice_rig/identify/covariance.h"

namespace brash_ice_rig {
namespace {

/// Rest before the lift that is used: more of it says nothing about the ice.
constexpr double kMostRestS = 6.0;

/// A broken line may miss the measured way by this much, m.
constexpr double kPathToleranceM = 0.006;
constexpr double kShortestPieceS = 2.0;

constexpr double kTimeGridS = 0.1, kHeightGridM = 0.005;
/// Of the rest after the last motion: rounded up, but for half a second, which is left out.
constexpr double kRestGridS = 5.0;

double rounded(double value, double grid) {
  // Divided by a whole number, so that 40.1 is the 40.1 of a text.
  return std::round(value / grid) / std::round(1.0 / grid);
}

struct Line {
  double start_s, end_s, mean_s, mean_m, slope_mps, largest_error_m;
  double at(double time_s) const { return mean_m + slope_mps * (time_s - mean_s); }
};

/// Least squares over the inside of a stretch: the hoist's ramps are at its ends.
Line fitLine(const std::vector<double>& t, const std::vector<double>& p, double start_s, double end_s) {
  const double margin = std::min(0.3, 0.2 * (end_s - start_s));
  double n = 0.0, st = 0.0, sp = 0.0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    if (t[i] < start_s + margin || t[i] > end_s - margin) continue;
    n += 1.0;
    st += t[i];
    sp += p[i];
  }
  Line line{start_s, end_s, 0.5 * (start_s + end_s), 0.0, 0.0, 0.0};
  if (n == 0.0) {
    const auto near = std::lower_bound(t.begin(), t.end(), line.mean_s) - t.begin();
    line.mean_m = p[std::min<std::size_t>(static_cast<std::size_t>(near), p.size() - 1)];
    return line;
  }
  line.mean_s = st / n;
  line.mean_m = sp / n;
  double stt = 0.0, stp = 0.0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    if (t[i] < start_s + margin || t[i] > end_s - margin) continue;
    stt += (t[i] - line.mean_s) * (t[i] - line.mean_s);
    stp += (t[i] - line.mean_s) * (p[i] - line.mean_m);
  }
  if (stt > 0.0) line.slope_mps = stp / stt;
  for (std::size_t i = 0; i < t.size(); ++i) {
    if (t[i] < start_s + margin || t[i] > end_s - margin) continue;
    line.largest_error_m = std::max(line.largest_error_m, std::abs(p[i] - line.at(t[i])));
  }
  return line;
}

/// Halves a stretch until lines are good enough.
void addLines(const std::vector<double>& t, const std::vector<double>& p, double start_s, double end_s,
              std::vector<Line>& lines) {
  const Line line = fitLine(t, p, start_s, end_s);
  const bool splittable = end_s - start_s >= 2.0 * kShortestPieceS;
  if (line.largest_error_m <= kPathToleranceM || !splittable) {
    lines.push_back(line);
    return;
  }
  const double middle = 0.5 * (start_s + end_s);
  addLines(t, p, start_s, middle, lines);
  addLines(t, p, middle, end_s, lines);
}

/// @param t, p  of the usable rows
HoistPath fitPath(const std::vector<double>& t, const std::vector<double>& p, const std::vector<RecordStage>& stages,
                  double& start_s) {
  std::vector<Line> lines;
  for (const RecordStage& stage : stages) {
    const bool moving = stage.kind == RecordStageKind::kLifting || stage.kind == RecordStageKind::kLowering;
    if (moving) {
      addLines(t, p, stage.start_s, stage.end_s, lines);
    } else {
      Line rest = fitLine(t, p, stage.start_s, stage.end_s);
      rest.slope_mps = 0.0;
      lines.push_back(rest);
    }
  }
  // Where two lines meet; where that is far from the end of the stretch, the lines hardly differ.
  std::vector<double> time, height;
  time.push_back(lines.front().start_s);
  height.push_back(lines.front().at(time[0]));
  for (std::size_t k = 0; k + 1 < lines.size(); ++k) {
    const Line &a = lines[k], &b = lines[k + 1];
    const double border = a.end_s, difference = a.slope_mps - b.slope_mps;
    double corner = border;
    if (std::abs(difference) > 1e-3) {
      const double meeting = border - (a.at(border) - b.at(border)) / difference;
      if (std::abs(meeting - border) < 1.0) corner = meeting;
    }
    time.push_back(corner);
    height.push_back(0.5 * (a.at(corner) + b.at(corner)));
  }
  time.push_back(lines.back().end_s);
  height.push_back(lines.back().at(time.back()));

  // The first line is rest before the motion: the path begins where it ends.
  const bool rests_first = stages.front().kind == RecordStageKind::kQuiet && lines.size() > 1;
  const std::size_t first = rests_first ? 1 : 0;
  start_s = time[first];
  HoistPath path;
  for (std::size_t k = first; k < time.size(); ++k) {
    const double at = rounded(time[k] - time[first], kTimeGridS);
    if (!path.time_s.empty() && at <= path.time_s.back()) continue;
    path.time_s.push_back(at);
    path.height_m.push_back(rounded(height[k] - height[first], kHeightGridM));
  }
  // How long somebody went on recording at rest is no matter of the procedure.
  const bool rests_last = lines.size() > 1 && lines.back().slope_mps == 0.0 && path.time_s.size() > 1;
  if (rests_last) {
    const double moved_s = path.time_s[path.time_s.size() - 2], rest_s = path.time_s.back() - moved_s;
    path.time_s.back() = rounded(moved_s + kRestGridS * std::ceil((rest_s - 0.5) / kRestGridS), kTimeGridS);
    path.height_m.back() = path.height_m[path.height_m.size() - 2];
    if (path.time_s.back() <= moved_s) {
      path.time_s.pop_back();
      path.height_m.pop_back();
    }
  }
  if (path.time_s.size() < 2) {
    path.time_s.push_back(path.time_s.back() + 1.0);
    path.height_m.push_back(path.height_m.back());
  }
  return path;
}

/// ln of the likelihood of means at rest whose own mean is unknown: every value of it is as likely.
double logLikelihoodAtRest(const ForceNoise& noise, const Eigen::VectorXd& means, const Eigen::VectorXd& time_s) {
  const Eigen::LLT<Eigen::MatrixXd> factor(computeNoiseCovariance(noise, time_s));
  const Eigen::VectorXd y = factor.matrixL().solve(means);
  const Eigen::VectorXd one = factor.matrixL().solve(Eigen::VectorXd::Ones(means.size()));
  const double along = y.dot(one) / one.squaredNorm();
  return -factor.matrixLLT().diagonal().array().log().sum() - 0.5 * std::log(one.squaredNorm()) -
         0.5 * (y - along * one).squaredNorm();
}

/// From the bins at rest: scatter within them is white, what is left between them is slow. A few seconds show little of
/// what changes within half a minute, so the slow part is that of Bayes' rule: its variance, mean over what is likely,
/// where 0.7 times as much as one sample scatters is expected, give or take half of that. Much more than that is no
/// noise of a sensor: swell moves a rig that touches the ice.
ForceNoise estimateNoise(const std::vector<double>& rest_time_s, const std::vector<std::vector<double>>& rest_bins,
                         double sigma_n) {
  constexpr double kExpected = 0.7, kLogSigma = 0.5, kLeast = 0.25, kMost = 2.5;
  double within = 0.0, samples = 0.0, bins = 0.0;
  std::vector<double> means, times;
  for (std::size_t k = 0; k < rest_bins.size(); ++k) {
    const std::vector<double>& bin = rest_bins[k];
    if (bin.size() < 2) continue;
    const double mean = std::accumulate(bin.begin(), bin.end(), 0.0) / static_cast<double>(bin.size());
    for (const double value : bin) within += (value - mean) * (value - mean);
    samples += static_cast<double>(bin.size() - 1);
    bins += static_cast<double>(bin.size());
    means.push_back(mean);
    times.push_back(rest_time_s[k]);
  }
  const double fallback = std::isfinite(sigma_n) ? sigma_n : 0.0;
  ForceNoise noise{fallback, fallback};
  if (means.size() >= 4 && within > 0.0) {
    const double sample = std::sqrt(within / samples);
    noise.white_n = sample / std::sqrt(bins / static_cast<double>(means.size()));
    const auto count = static_cast<Eigen::Index>(means.size());
    const Eigen::Map<const Eigen::VectorXd> y(means.data(), count), t(times.data(), count);
    std::vector<double> ratios, weights;
    constexpr int kSteps = 40;
    for (int k = 0; k <= kSteps; ++k) {
      const double log_ratio = std::log(kLeast) + std::log(kMost / kLeast) * k / kSteps;
      const double off = (log_ratio - std::log(kExpected)) / kLogSigma;
      ratios.push_back(std::exp(log_ratio));
      weights.push_back(logLikelihoodAtRest({noise.white_n, ratios.back() * sample}, y, t) - 0.5 * off * off);
    }
    const double top = *std::max_element(weights.begin(), weights.end());
    double sum = 0.0, square = 0.0;
    for (std::size_t k = 0; k < ratios.size(); ++k) {
      sum += std::exp(weights[k] - top);
      square += std::exp(weights[k] - top) * ratios[k] * ratios[k];
    }
    noise.slow_n = sample * std::sqrt(square / sum);
  }
  noise.white_n = std::max(noise.white_n, 1.0);  // a synthetic record without any
  noise.slow_n = std::max(noise.slow_n, 1.0);
  return noise;
}

}  // namespace

std::vector<double> computeTravel(const HoistPath& path) {
  std::vector<double> travel_m{0.0};
  for (std::size_t k = 1; k < path.time_s.size(); ++k) {
    travel_m.push_back(travel_m.back() + std::abs(path.height_m[k] - path.height_m[k - 1]));
  }
  return travel_m;
}

Observation makeObservation(const Record& record, const RecordReport& report) {
  assert(report.usability() != Usability::kNo);
  Observation o;
  std::vector<double> t, p, f;
  for (const std::size_t row : report.rows) {
    t.push_back(record.time_s[row]);
    p.push_back(record.hoist_position_m[row]);
    f.push_back(record.force_n[row] - record.tare_n);
  }
  o.path = fitPath(t, p, report.stages, o.start_s);
  o.clock_sigma_s = 0.1;
  if (report.clock && report.clock->from_stops) {
    o.clock_offset_s = report.clock->offset_s;
    o.clock_sigma_s = std::max(0.03, report.clock->sigma_s);
  }
  for (const Finding& finding : report.findings) {
    if (finding.code == "no_contact") o.ice_contact = false;
  }

  const double first = std::max(-kMostRestS, t.front() - o.clock_offset_s - o.start_s);
  const double last = std::min(o.path.time_s.back(), t.back() - o.clock_offset_s - o.start_s);
  const auto low = static_cast<long>(std::ceil(first / kBinS)), high = static_cast<long>(std::floor(last / kBinS));
  std::vector<std::vector<double>> bins(static_cast<std::size_t>(std::max(high - low, 0L)));
  const bool lateral = !record.force_x_n.empty() && !record.force_y_n.empty();
  std::vector<Eigen::Vector3d> lateral_sums(bins.size(), Eigen::Vector3d::Zero());  // x, y, how many
  for (std::size_t i = 0; i < t.size(); ++i) {
    const auto bin = static_cast<long>(std::floor((t[i] - o.clock_offset_s - o.start_s) / kBinS)) - low;
    if (bin < 0 || bin >= static_cast<long>(bins.size())) continue;
    bins[static_cast<std::size_t>(bin)].push_back(f[i]);
    if (!lateral) continue;
    const double x = record.force_x_n[report.rows[i]], y = record.force_y_n[report.rows[i]];
    if (std::isfinite(x) && std::isfinite(y)) lateral_sums[static_cast<std::size_t>(bin)] += Eigen::Vector3d(x, y, 1.0);
  }
  std::vector<double> time, force, way;
  std::vector<Eigen::Vector2d> sideways;
  std::vector<std::vector<double>> rest;
  std::vector<double> rest_time;
  for (std::size_t k = 0; k < bins.size(); ++k) {
    const double middle = (static_cast<double>(low + static_cast<long>(k)) + 0.5) * kBinS;
    if (middle < -0.5) {
      rest.push_back(bins[k]);
      rest_time.push_back(middle);
    }
    if (bins[k].empty()) continue;
    time.push_back(middle);
    force.push_back(std::accumulate(bins[k].begin(), bins[k].end(), 0.0) / static_cast<double>(bins[k].size()));
    way.push_back(valueOfBrokenLine(o.path.time_s, o.path.height_m, middle));
    const Eigen::Vector2d before = sideways.empty() ? Eigen::Vector2d(0.0, 0.0) : sideways.back();
    sideways.push_back(lateral_sums[k].z() > 0.0 ? Eigen::Vector2d(lateral_sums[k].head<2>() / lateral_sums[k].z())
                                                 : before);
  }
  const auto count = static_cast<Eigen::Index>(time.size());
  o.time_s = Eigen::Map<Eigen::VectorXd>(time.data(), count);
  o.force_n = Eigen::Map<Eigen::VectorXd>(force.data(), count);
  o.way_m = Eigen::Map<Eigen::VectorXd>(way.data(), count);
  if (lateral) {
    o.lateral_n.resize(count, 2);
    for (Eigen::Index i = 0; i < count; ++i) o.lateral_n.row(i) = sideways[static_cast<std::size_t>(i)].transpose();
    const Eigen::Index at_rest = (o.time_s.array() < -0.5).count();
    if (at_rest > 0) o.lateral_n.rowwise() -= Eigen::RowVector2d(o.lateral_n.topRows(at_rest).colwise().mean());
  }
  o.travel_m = Eigen::VectorXd::Zero(count);
  const std::vector<double> travel = computeTravel(o.path);
  for (Eigen::Index i = 0; i < count; ++i) o.travel_m[i] = valueOfBrokenLine(o.path.time_s, travel, o.time_s[i]);
  o.noise = estimateNoise(rest_time, rest, report.noise_sigma_n);
  return o;
}

SimulatedForce readSimulatedForce(const std::string& directory, double rest_s) {
  const std::string path = directory + "/force.csv";
  const CsvTable table =
      readCsv(path, {"time_s", "force_n", "weight_n", "buoyancy_n", "force_x_n", "force_y_n", "hoist_position_m"});
  for (const auto& column : table.columns) {
    if (!column) {
      throw ConfigError("", "", "lacks a column of time, force, weight, buoyancy, lateral force or position", path);
    }
  }
  SimulatedForce force;
  const std::vector<double>&time = *table.columns[0], &reading = *table.columns[1], &weight = *table.columns[2],
        &buoyancy = *table.columns[3], &height = *table.columns[6];
  const double empty = weight.front() - buoyancy.front();
  double start_m = 0.0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (time[i] < -rest_s - 1e-6) continue;
    if (force.time_s.empty()) start_m = height[i];
    force.time_s.push_back(time[i]);
    force.way_m.push_back(height[i] - start_m);
    force.force_n.push_back(reading[i] - empty);
    force.empty_force_n.push_back(weight[i] - buoyancy[i] - empty);
    force.force_x_n.push_back((*table.columns[4])[i]);
    force.force_y_n.push_back((*table.columns[5])[i]);
  }
  if (force.time_s.size() < 2) throw ConfigError("", "", "holds no lift", path);
  return force;
}

Eigen::VectorXd binned(const std::vector<double>& time_s, const std::vector<double>& force_n,
                       const Eigen::VectorXd& bin_time_s, double delay_s) {
  // Mean of the broken line through the samples, by its integral.
  std::vector<double> integral(time_s.size(), 0.0);
  for (std::size_t i = 1; i < time_s.size(); ++i) {
    integral[i] = integral[i - 1] + 0.5 * (force_n[i] + force_n[i - 1]) * (time_s[i] - time_s[i - 1]);
  }
  const auto integralTo = [&](double t) {
    if (t <= time_s.front()) return (t - time_s.front()) * force_n.front();
    if (t >= time_s.back()) return integral.back() + (t - time_s.back()) * force_n.back();
    const auto next = static_cast<std::size_t>(std::upper_bound(time_s.begin(), time_s.end(), t) - time_s.begin());
    const double step = t - time_s[next - 1];
    const double at = valueOfBrokenLine(time_s, force_n, t);
    return integral[next - 1] + 0.5 * (force_n[next - 1] + at) * step;
  };
  Eigen::VectorXd means(bin_time_s.size());
  for (Eigen::Index i = 0; i < means.size(); ++i) {
    const double from = bin_time_s[i] - 0.5 * kBinS - delay_s;
    means[i] = (integralTo(from + kBinS) - integralTo(from)) / kBinS;
  }
  return means;
}

}  // namespace brash_ice_rig
