#include "brash_ice_rig/identify/record_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <utility>

#include "brash_ice_rig/rig/collector.h"

namespace brash_ice_rig {
namespace {

// Thresholds, with their reasons. doc/records.md repeats them for those who make records.

/// Rows with a time out of order: up to here a glitch of the logger; above, the clock itself cannot be trusted.
constexpr double kMaxDisorderShare = 0.01;
/// Rows without a force reading: the fit works on means over 0.25 s, which survive a few that are missing.
constexpr double kMaxMissingShare = 0.05;
/// Below this there is no curve to speak of.
constexpr std::size_t kMinSamples = 50;
/// The fit works on means over 0.25 s.
constexpr double kBinRateHz = 4.0;
/// The peak is a mean over 1 s: without a sample in each second there is none.
constexpr double kMinRateHz = 1.0;
/// A hole that leaves two bins without a sample, and is no ordinary interval of this record either.
constexpr double kMinGapS = 0.5;
constexpr double kMinGapIntervals = 3.0;
/// Share of the lift without samples above which its curve is guesswork.
constexpr double kMaxGapShare = 0.2;
/// No pull-up lifts by more; in mm or cm all of them do.
constexpr double kMaxTravelM = 50.0;
/// A lift shorter than this moves the ice by less than the gaps between its blocks.
constexpr double kMinLiftM = 0.05;
/// A clock in ms or µs: intervals of more than this, and a hoist that then creeps by less than the speed below.
constexpr double kLongIntervalS = 1.5;
constexpr double kCreepMps = 0.002;
/// The hoist of such a rig is slower.
constexpr double kMaxHoistMps = 1.0;
/// Integrated speed over the change of position: beyond these one of the two has a wrong unit or scale.
constexpr double kMinSpeedRatio = 0.8;
constexpr double kMaxSpeedRatio = 1.25;
/// Rise of the force in weights of the ice above the collector (0.7 in the simulation B-1). The
/// pole that leaves the water gives 0.005 without any ice; what was recorded in kN or t stays below 0.002, in kgf it is
/// 0.02 to 0.1, and in gf or mN above 20.
constexpr double kMaxKilonewtonRise = 0.002;
constexpr double kMinContactRise = 0.01;
constexpr double kMinOrdinaryRise = 0.1;
constexpr double kMaxRise = 20.0;
/// A rise is told from noise by this many standard deviations of a single reading, although it is a mean over 1 s:
/// noise of sea and crane is slow.
constexpr double kClearSigmas = 5.0;
/// In a wrong unit, the curve is as clear as in the right one.
constexpr double kCurveSigmas = 20.0;
/// A flat top: so many equal readings in a row, and either far more than at any other value, or between slopes that
/// would have gone on by more than so many steps of the resolution (the flat top of a parabola is long enough for its
/// slopes to go on by 4), beyond what white noise can feign.
constexpr std::size_t kFlatSamples = 5;
constexpr std::size_t kFlatLongerThanOthers = 3;
constexpr double kFlatSteps = 8.0;
constexpr double kFlatSigmas = 4.0;
constexpr double kMaxFlatShare = 0.3;  ///< of the lift
/// Resolution over rise: above, rounding is as large as the effects that are looked for.
constexpr double kMaxResolutionRatio = 0.02;
/// Twenty bins give the noise to within 16 %.
constexpr double kMinQuietS = 5.0;
/// Clock offsets are looked for in windows around each start and stop.
constexpr double kEventWindowS = 2.0;
constexpr double kMinEventSideS = 0.75;
/// Above, a stop would show as a false effect of several per cent of the peak.
constexpr double kMaxOffsetSigmaS = 0.25;
/// An offset below this moves a force that rises by 10 % of the peak a second by 1 %.
constexpr double kMinOffsetS = 0.1;
constexpr double kOffsetSigmas = 3.0;

/// Numbers beyond this are garbage, and their sums and squares would overflow. A clock that counts ns since 1970 is
/// below.
constexpr double kLargestNumber = 1.0e19;

/// Finite, and small enough to be reckoned with.
bool isUsable(double value) {
  return std::abs(value) <= kLargestNumber;
}

/// The rows that can be worked with.
struct Samples {
  std::vector<std::size_t> row;
  std::vector<double> time_s, reading_n, force_n, position_m, speed_mps;  ///< force: tare taken off
  double interval_s = 0.0;                                                ///< median

  std::size_t size() const { return row.size(); }
  double duration() const { return time_s.back() - time_s.front(); }
  /// First sample not before a time.
  std::size_t at(double time) const {
    const auto found = std::lower_bound(time_s.begin(), time_s.end(), time);
    return static_cast<std::size_t>(found - time_s.begin());
  }
};

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Rounded to some digits; without an exponent where people would not write one.
std::string number(double value, int digits = 3) {
  char text[32];
  const double magnitude = std::abs(value);
  if (magnitude < 1.0e-3 || !(magnitude < 1.0e9)) {
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    return text;
  }
  const double step = std::pow(10.0, std::floor(std::log10(magnitude)) + 1.0 - digits);
  std::snprintf(text, sizeof text, "%.10g", step * std::round(value / step));
  return text;
}

/// To a hundredth, as offsets of clocks deserve.
std::string seconds(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

std::string percent(double share) {
  return number(100.0 * share, 2) + " %";
}

/// Mean over a window around each sample.
std::vector<double> runningMean(const std::vector<double>& time_s, const std::vector<double>& values, double window_s) {
  std::vector<double> sum(values.size() + 1, 0.0);
  std::partial_sum(values.begin(), values.end(), sum.begin() + 1);
  std::vector<double> mean(values.size());
  std::size_t first = 0;
  std::size_t last = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    while (time_s[first] < time_s[i] - 0.5 * window_s) ++first;
    while (last < values.size() && time_s[last] <= time_s[i] + 0.5 * window_s) ++last;
    mean[i] = (sum[last] - sum[first]) / static_cast<double>(last - first);
  }
  return mean;
}

/// Least-squares straight line.
struct Line {
  double slope = 0.0, sigma = 0.0;  ///< sigma: standard deviation about it
};

Line fitLine(const std::vector<double>& t, const std::vector<double>& y, std::size_t first, std::size_t last) {
  const double count = static_cast<double>(last - first);
  if (count < 3.0) return {};
  double t_mean = 0.0;
  double y_mean = 0.0;
  for (std::size_t i = first; i < last; ++i) {
    t_mean += t[i] / count;
    y_mean += y[i] / count;
  }
  double tt = 0.0;
  double ty = 0.0;
  double yy = 0.0;
  for (std::size_t i = first; i < last; ++i) {
    tt += (t[i] - t_mean) * (t[i] - t_mean);
    ty += (t[i] - t_mean) * (y[i] - y_mean);
    yy += (y[i] - y_mean) * (y[i] - y_mean);
  }
  return {ty / tt, std::sqrt(std::max(0.0, yy - ty * ty / tt) / (count - 2.0))};
}

// ---- rows

/// The most rows whose times increase strictly: the longest increasing subsequence. A single time that is far off then
/// costs one row, wherever it points.
std::vector<std::size_t> rowsInOrder(const std::vector<double>& time_s) {
  std::vector<std::size_t> ends;  // of the best sequence of each length
  std::vector<std::size_t> before(time_s.size());
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    if (!isUsable(time_s[i])) continue;
    const auto place = std::lower_bound(ends.begin(), ends.end(), time_s[i],
                                        [&](std::size_t row, double time) { return time_s[row] < time; });
    before[i] = place == ends.begin() ? i : *(place - 1);
    if (place == ends.end()) {
      ends.push_back(i);
    } else {
      *place = i;
    }
  }
  std::vector<std::size_t> rows(ends.size());
  for (std::size_t k = ends.size(), row = ends.empty() ? 0 : ends.back(); k-- > 0; row = before[row]) rows[k] = row;
  return rows;
}

Samples samplesOf(const Record& record, const std::vector<std::size_t>& in_order) {
  Samples samples;
  for (const std::size_t row : in_order) {
    const bool usable = isUsable(record.force_n[row]) && isUsable(record.hoist_position_m[row]) &&
                        isUsable(record.hoist_speed_mps[row]);
    if (!usable) continue;
    samples.row.push_back(row);
    samples.time_s.push_back(record.time_s[row]);
    samples.reading_n.push_back(record.force_n[row]);
    samples.force_n.push_back(record.force_n[row] - record.tare_n);
    samples.position_m.push_back(record.hoist_position_m[row]);
    samples.speed_mps.push_back(record.hoist_speed_mps[row]);
  }
  std::vector<double> intervals;
  for (std::size_t i = 1; i < samples.size(); ++i) intervals.push_back(samples.time_s[i] - samples.time_s[i - 1]);
  samples.interval_s = median(std::move(intervals));
  return samples;
}

using Findings = std::vector<Finding>;

Findings checkTime(const Record& record, const std::vector<std::size_t>& in_order) {
  const double count = static_cast<double>(record.size());
  std::size_t missing = 0;
  std::optional<std::size_t> first_missing;
  std::optional<std::size_t> first_repeated;
  std::optional<std::size_t> first_backward;
  double latest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < record.size(); ++i) {
    const double time = record.time_s[i];
    if (!isUsable(time)) {
      ++missing;
      if (!first_missing) first_missing = i;
      continue;
    }
    if (time == latest && !first_repeated) first_repeated = i;
    if (time < latest && !first_backward) first_backward = i;
    latest = time;
  }
  Findings findings;
  if (missing > 0) {
    const double share = static_cast<double>(missing) / count;
    findings.push_back({share > kMaxDisorderShare ? Severity::kRefuse : Severity::kDegraded, "time_missing",
                        first_missing, std::to_string(missing) + " rows have no time (" + percent(share) + ")",
                        share > kMaxDisorderShare
                            ? "if the rows are evenly spaced, write the times anew from their number"
                            : "these rows are left out"});
  }
  const std::size_t dropped = record.size() - missing - in_order.size();
  if (dropped > 0) {
    const double share = static_cast<double>(dropped) / count;
    const bool backward = first_backward.has_value();
    const bool refused = share > kMaxDisorderShare;
    findings.push_back(
        {refused ? Severity::kRefuse : Severity::kDegraded, backward ? "time_backward" : "time_repeated",
         backward ? first_backward : first_repeated,
         std::to_string(dropped) + " rows (" + percent(share) + ") " +
             (backward ? "lie earlier than, or at the same time as, others before them"
                       : "repeat the time before them"),
         !refused ? "these rows are left out"
         : backward
             ? "two recordings in one file, or a clock that was set: cut the file there"
             : "the times are rounded: have the logger write more digits, or write them anew from the row's number"});
  }
  return findings;
}

Findings checkReadings(const Record& record) {
  Findings findings;
  const auto look = [&](const std::vector<double>& values, const std::string& code, const std::string& what) {
    const auto first = std::find_if_not(values.begin(), values.end(), isUsable);
    if (first == values.end()) return;
    const auto missing = values.end() - first - std::count_if(first, values.end(), isUsable);
    const double share = static_cast<double>(missing) / static_cast<double>(values.size());
    const bool refused = share > kMaxMissingShare;
    findings.push_back({refused ? Severity::kRefuse : Severity::kDegraded, code,
                        static_cast<std::size_t>(first - values.begin()),
                        std::to_string(missing) + " rows (" + percent(share) + ") have no finite " + what,
                        refused ? "see whether the logger lost its channel; cut the file to the part that has it"
                                : "these rows are left out"});
  };
  look(record.force_n, "force_missing", "force");
  look(record.hoist_position_m, "motion_missing", "position");
  return findings;
}

Findings checkSampleCount(const Samples& samples) {
  if (samples.size() >= kMinSamples) return {};
  return {{Severity::kRefuse, "too_few_samples", std::nullopt,
           std::to_string(samples.size()) + " usable rows, at least " + std::to_string(kMinSamples) + " are needed",
           "nothing; record again"}};
}

// ---- units and rate

Findings checkTimeUnit(const Samples& samples, double travel_m, bool position_given) {
  if (samples.interval_s <= kLongIntervalS) return {};
  const double fastest_mps = *std::max_element(samples.speed_mps.begin(), samples.speed_mps.end());
  // Where the position comes from the speed, it is the way that becomes too long.
  const bool creeps = travel_m / samples.duration() < kCreepMps;
  const bool flies = !position_given && travel_m > kMaxTravelM && fastest_mps < kMaxHoistMps;
  if (!creeps && !flies) return {};
  const bool micro = samples.interval_s > 1000.0;
  return {{Severity::kRefuse, "time_unit", std::nullopt,
           "a sample every " + number(samples.interval_s) + " s: the time is probably in " + (micro ? "µs" : "ms"),
           std::string("divide time_s by ") + (micro ? "1000000" : "1000")}};
}

Findings checkPositionUnit(double travel_m, double expected_m, bool position_given) {
  if (travel_m <= kMaxTravelM) return {};
  const auto misfit = [&](double factor) { return std::abs(std::log(travel_m / factor / expected_m)); };
  const char* column = position_given ? "hoist_position_m" : "the speed";
  const double factor = misfit(1000.0) < misfit(100.0) ? 1000.0 : 100.0;
  std::string unit = factor == 1000.0 ? "mm" : "cm";
  if (!position_given) unit += "/s, or m/min";
  return {{Severity::kRefuse, "position_unit", std::nullopt,
           "the hoist travels " + number(travel_m) + " m: " + column + " is probably in " + unit,
           position_given ? "divide " + std::string(column) + " by " + number(factor, 4) : "give the speed in m/s"}};
}

Findings checkSpeedAgrees(const Samples& samples, double travel_m) {
  double way_m = 0.0;
  double speed_way_m = 0.0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double dt = samples.time_s[i] - samples.time_s[i - 1];
    way_m += samples.position_m[i] - samples.position_m[i - 1];
    speed_way_m += 0.5 * dt * (samples.speed_mps[i] + samples.speed_mps[i - 1]);
  }
  // A lowering and a lift that cancel out leave nothing to compare.
  if (way_m < 0.2 * travel_m || way_m < kMinLiftM) return {};
  const double ratio = speed_way_m / way_m;
  if (ratio > kMinSpeedRatio && ratio < kMaxSpeedRatio) return {};
  return {
      {Severity::kDegraded, "speed_disagrees", std::nullopt,
       "hoist_speed_mps adds up to " + number(ratio) + " times the change of hoist_position_m",
       "one of them has a wrong unit, scale or sign; correct or remove it. The position is used, and the stages below "
       "are as wrong as the speed"}};
}

Findings checkRate(const Samples& samples) {
  const double rate_hz = 1.0 / samples.interval_s;
  // Half a per cent: times are rounded.
  if (rate_hz > 0.995 * kBinRateHz) return {};
  const bool refused = rate_hz < 0.995 * kMinRateHz;
  return {{refused ? Severity::kRefuse : Severity::kDegraded, "rate_low", std::nullopt,
           number(rate_hz) + " samples a second, " + number(kBinRateHz) + " are needed, 20 or more are good",
           refused ? "nothing; the peak cannot be told from it"
                   : "level and slow changes can be compared; break-out, drops and stops are smeared"}};
}

Findings checkGaps(const Samples& samples, const TimeSpan& lift) {
  const double limit_s = std::max(kMinGapS, kMinGapIntervals * samples.interval_s);
  std::size_t count = 0;
  std::size_t largest = 0;
  double largest_s = 0.0;
  double in_lift_s = 0.0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double gap_s = samples.time_s[i] - samples.time_s[i - 1];
    if (gap_s <= limit_s) continue;
    ++count;
    in_lift_s += std::max(0.0, std::min(lift.end_s, samples.time_s[i]) - std::max(lift.start_s, samples.time_s[i - 1]));
    if (gap_s <= largest_s) continue;
    largest_s = gap_s;
    largest = i;
  }
  if (count == 0) return {};
  const double share = in_lift_s / std::max(lift.end_s - lift.start_s, samples.interval_s);
  const bool refused = share > kMaxGapShare;
  return {{refused ? Severity::kRefuse : Severity::kDegraded, "gap", samples.row[largest],
           std::to_string(count) + (count == 1 ? " gap" : " gaps") + " without samples, the largest " +
               number(largest_s) + " s before this row; " + percent(share) + " of the lift is missing",
           refused ? "cut the record to its longest part without gaps and see how much of the lift that covers"
                   : "the fit leaves these times out; what happens in them cannot be seen"}};
}

// ---- motion

std::vector<RecordStage> stagesOf(const Samples& samples) {
  constexpr double kSmoothS = 0.5;
  constexpr double kMinStageS = 0.5;
  constexpr double kMovingShare = 0.25;  // of the hoist's usual speed
  const std::vector<double> speed_mps = runningMean(samples.time_s, samples.speed_mps, kSmoothS);
  // The hoist's usual speed is that of most of the way, not of most of the time.
  double way = 0.0;
  double weighted = 0.0;
  for (const double speed : speed_mps) {
    way += std::abs(speed);
    weighted += speed * speed;
  }
  const double threshold = way > 0.0 ? kMovingShare * weighted / way : 0.0;
  const auto kindOf = [&](double speed) {
    if (threshold == 0.0 || std::abs(speed) < threshold) return RecordStageKind::kHolding;
    return speed > 0.0 ? RecordStageKind::kLifting : RecordStageKind::kLowering;
  };
  std::vector<RecordStage> raw;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const RecordStageKind kind = kindOf(speed_mps[i]);
    if (raw.empty() || raw.back().kind != kind) {
      if (!raw.empty()) raw.back().end_s = samples.time_s[i];
      raw.push_back({kind, samples.time_s[i], samples.time_s[i]});
    }
    raw.back().end_s = samples.time_s[i];
  }
  // What is too short to mean anything belongs to the stage before it, the first of all to the one behind.
  std::vector<RecordStage> stages;
  for (const RecordStage& stage : raw) {
    if (!stages.empty() && (stage.end_s - stage.start_s < kMinStageS || stages.back().kind == stage.kind)) {
      stages.back().end_s = stage.end_s;
    } else {
      stages.push_back(stage);
    }
  }
  if (stages.size() > 1 && stages.front().end_s - stages.front().start_s < kMinStageS) {
    stages[1].start_s = stages[0].start_s;
    stages.erase(stages.begin());
  }
  for (RecordStage& stage : stages) {
    if (stage.kind == RecordStageKind::kLifting) break;
    if (stage.kind == RecordStageKind::kHolding) stage.kind = RecordStageKind::kQuiet;
  }
  return stages;
}

bool isLift(const RecordStage& stage) {
  return stage.kind == RecordStageKind::kLifting;
}

/// From the start of the first to the end of the last lifting.
std::optional<TimeSpan> liftOf(const std::vector<RecordStage>& stages) {
  const auto first = std::find_if(stages.begin(), stages.end(), isLift);
  if (first == stages.end()) return std::nullopt;
  return TimeSpan{first->start_s, std::find_if(stages.rbegin(), stages.rend(), isLift)->end_s};
}

/// The longest rest before the first lift.
std::optional<TimeSpan> quietOf(const std::vector<RecordStage>& stages) {
  std::optional<TimeSpan> quiet;
  for (const RecordStage& stage : stages) {
    if (stage.kind != RecordStageKind::kQuiet) continue;
    if (quiet && stage.end_s - stage.start_s <= quiet->end_s - quiet->start_s) continue;
    quiet = TimeSpan{stage.start_s, stage.end_s};
  }
  return quiet;
}

double liftLength(const Samples& samples, const TimeSpan& lift) {
  const auto first = samples.position_m.begin() + static_cast<std::ptrdiff_t>(samples.at(lift.start_s));
  return first == samples.position_m.end() ? 0.0 : *std::max_element(first, samples.position_m.end()) - *first;
}

/// Way from the start of the lift until the hub stands at the top of the undisturbed ice. By then the collector is out
/// of the field and the force is level, in the paper's test as in the simulation.
double wholeLift(const Scenario& scenario) {
  return latticeThickness(scenario.field) - iceDraft(scenario) - lowestHubHeight(scenario);
}

/// By which the force rises where a rig without ice leaves the water for good, N: what has borne it there.
double emptyRise(const Scenario& scenario) {
  return Collector(scenario.collector, true).buoyancy(lowestHubHeight(scenario), scenario.water.density_kgpm3);
}

/// Of the undisturbed ice above the unfolded collector, an octagon, N.
double iceWeight(const Scenario& scenario) {
  const double area_m2 = 2.0 * std::sqrt(2.0) * scenario.collector.radius_m * scenario.collector.radius_m;
  const double density_kgpm3 = (1.0 - scenario.ice.void_fraction) * scenario.ice.parent_density_kgpm3;
  return area_m2 * latticeThickness(scenario.field) * density_kgpm3 * kGravityMps2;
}

Findings checkLift(double lift_m, double whole_m) {
  if (lift_m < kMinLiftM) {
    return {{Severity::kRefuse, "no_lift", std::nullopt,
             "the hoist never goes up by more than " + number(kMinLiftM) + " m",
             "see whether position and speed count up as positive, and whether this is the right part of the test"}};
  }
  if (lift_m >= whole_m) return {};
  const double share = lift_m / whole_m;
  // Where the simulated force of the default scenario peaks: 1.18 m of 1.5 m.
  constexpr double kPeakShare = 0.8;
  return {
      {Severity::kDegraded, "too_short", std::nullopt,
       "the lift covers the first " + number(lift_m) + " m of the " + number(whole_m) +
           " m that bring the collector above the ice (" + percent(share) + "): " +
           (share < kPeakShare ? "break-out and rise, perhaps not the peak and not the level after it"
                               : "break-out, rise and peak, but not the level after it"),
       "effects of the missing part cannot be told; if rig or ice differ from what is assumed, give `rig` and `ice`"}};
}

// ---- force

/// Standard deviation of white noise, from second differences: slopes do not count. Robust against jumps.
double whiteNoise(const std::vector<double>& reading_n) {
  std::vector<double> bends;
  for (std::size_t i = 2; i < reading_n.size(); ++i) {
    bends.push_back(std::abs(reading_n[i] - 2.0 * reading_n[i - 1] + reading_n[i - 2]));
  }
  constexpr double kMedianOverSigma = 0.6745;  // of the magnitude of a normal variable
  return median(std::move(bends)) / (kMedianOverSigma * std::sqrt(6.0));
}

/// Step of which the differences between readings are multiples; 0: none.
double resolutionOf(std::vector<double> reading_n) {
  constexpr double kNear = 50.0;  // steps; farther multiples prove nothing, with rounded decimals
  constexpr double kTolerance = 0.02;
  std::sort(reading_n.begin(), reading_n.end());
  const double range_n = reading_n.back() - reading_n.front();
  std::vector<double> steps;
  for (std::size_t i = 1; i < reading_n.size(); ++i) {
    const double step = reading_n[i] - reading_n[i - 1];
    if (step > 1.0e-9 * range_n) steps.push_back(step);
  }
  if (steps.size() < 5) return 0.0;
  const double least = *std::min_element(steps.begin(), steps.end());
  std::size_t near = 0;
  std::size_t multiples = 0;
  for (const double step : steps) {
    const double ratio = step / least;
    if (ratio > kNear) continue;
    ++near;
    if (std::abs(ratio - std::round(ratio)) < kTolerance) ++multiples;
  }
  const bool found = 2 * near > steps.size() && static_cast<double>(multiples) > 0.99 * static_cast<double>(near);
  return found ? least : 0.0;
}

Findings checkConstantForce(const Samples& samples) {
  const auto [least, most] = std::minmax_element(samples.reading_n.begin(), samples.reading_n.end());
  if (*least < *most) return {};
  return {{Severity::kRefuse, "force_constant", std::nullopt, "the force is " + number(*most) + " N throughout",
           "nothing; the load cell was not connected, or the wrong channel was written"}};
}

/// What the lift does to the force.
struct Rise {
  double force_n = 0.0;
  std::size_t row = 0;  ///< where
};

/// The 1 s mean farthest from that of the empty rig.
Rise riseOf(const Samples& samples, const std::vector<double>& mean_n, const TimeSpan& lift,
            const std::optional<TimeSpan>& quiet) {
  double rest_n = 0.0;
  if (quiet) {
    const std::size_t first = samples.at(quiet->start_s);
    const std::size_t last = samples.at(quiet->end_s);
    for (std::size_t i = first; i < last; ++i) rest_n += samples.force_n[i] / static_cast<double>(last - first);
  }
  Rise rise;
  for (std::size_t i = samples.at(lift.start_s); i < samples.size(); ++i) {
    if (std::abs(mean_n[i] - rest_n) > std::abs(rise.force_n)) rise = {mean_n[i] - rest_n, samples.row[i]};
  }
  return rise;
}

/// Sign, unit and ice contact hang together: all are read from how far the force goes.
/// @param ice_weight_n  of the ice above the collector  @param empty_rise_n  of a rig that leaves the water without any
Findings checkRise(const Rise& rise, double ice_weight_n, double empty_rise_n, double sigma_n) {
  const double rise_n = rise.force_n;
  const double ratio = std::abs(rise_n) / ice_weight_n;
  const bool is_curve = std::abs(rise_n) > kCurveSigmas * sigma_n;
  const std::string far =
      number(std::abs(rise_n)) + " N, where the ice above the collector weighs " + number(ice_weight_n) + " N";
  Findings findings;
  if (rise_n < 0.0 && std::abs(rise_n) > kClearSigmas * sigma_n && (ratio > kMinContactRise || is_curve)) {
    findings.push_back({Severity::kRefuse, "sign", rise.row,
                        "the force falls by " + number(-rise_n) +
                            " N during the lift; it must be > 0 when the rig pulls "
                            "down on the crane",
                        "change the sign of force_n, and of tare_n with it"});
  }
  if (ratio > kMaxRise) {
    findings.push_back({Severity::kRefuse, "force_unit", rise.row, "the force changes by " + far,
                        "it is probably in mN or gf, or counts of a converter: give N; or a single reading here is "
                        "wild: take it out. If the rig is far larger than "
                        "assumed, give `rig` and `ice`"});
  } else if (ratio < kMaxKilonewtonRise && is_curve) {
    findings.push_back(
        {Severity::kRefuse, "force_unit", rise.row, "the force changes by " + far,
         "it is probably in kN (multiply by 1000) or t (by 9807). If the rig is far smaller than assumed, "
         "give `rig` and `ice`"});
  } else if (ratio < kMinContactRise || std::abs(rise_n) < kClearSigmas * sigma_n ||
             (ratio < kMinOrdinaryRise && std::abs(rise_n) < empty_rise_n + kClearSigmas * sigma_n)) {
    findings.push_back(
        {Severity::kDegraded, "no_contact", rise.row, "the force never rises above that of the empty rig: by " + far,
         "as the lift without ice of a test it tells bias, drift and noise of the load cell; of the ice it "
         "tells nothing"});
  } else if (ratio < kMinOrdinaryRise) {
    findings.push_back(
        {Severity::kDegraded, "force_small", rise.row, "the force changes by " + far,
         "if it is in kgf or lbf, multiply by 9.807 or 4.448; if it is right, hardly any ice was lifted and "
         "little can be told"});
  }
  return findings;
}

Findings checkSaturation(const Samples& samples, const TimeSpan& lift, double resolution_n, double white_n) {
  const std::vector<double>& reading_n = samples.reading_n;
  const double most = *std::max_element(reading_n.begin(), reading_n.end());
  std::size_t first = 0;
  std::size_t length = 0;
  std::size_t longest_other = 0;
  double flat_s = 0.0;
  for (std::size_t i = 0, end = 0; i < reading_n.size(); i = end) {
    while (end < reading_n.size() && reading_n[end] == reading_n[i]) ++end;
    if (reading_n[i] != most) {
      longest_other = std::max(longest_other, end - i);
      continue;
    }
    if (end - i >= kFlatSamples) flat_s += samples.time_s[end - 1] - samples.time_s[i];
    if (end - i > length) {
      first = i;
      length = end - i;
    }
  }
  if (length < kFlatSamples) return {};
  const std::size_t end = first + length;
  const double run_s = samples.time_s[end - 1] - samples.time_s[first];
  constexpr double kBesideS = 0.5;
  const std::size_t before =
      std::min(samples.at(samples.time_s[first] - kBesideS), first - std::min<std::size_t>(first, 5));
  const std::size_t after = std::max(samples.at(samples.time_s[end - 1] + kBesideS), std::min(end + 5, samples.size()));
  // On both sides: an ordinary peak may end in a sudden fall. At the end of the record there is one side only.
  double slope = std::abs(fitLine(samples.time_s, reading_n, before, first).slope);
  if (end < reading_n.size()) {
    slope = std::min(slope, std::abs(fitLine(samples.time_s, reading_n, end, after).slope));
  }
  const bool too_steep = slope * run_s > kFlatSteps * resolution_n + kFlatSigmas * white_n;
  const bool too_long = length > 2 * kFlatSamples && length > kFlatLongerThanOthers * longest_other;
  if (!too_steep && !too_long) return {};
  const double share = flat_s / std::max(lift.end_s - lift.start_s, run_s);
  const bool refused = share > kMaxFlatShare;
  return {{refused ? Severity::kRefuse : Severity::kDegraded, "saturation", samples.row[first],
           "the force stays at its largest value, " + number(most, 5) + " N, for " + number(run_s) +
               " s from here: the end of the load cell's or amplifier's range",
           refused ? "nothing; record again with a larger range"
                   : "the peak is at least this; flat parts must be left out, and effects at the peak cannot be told"}};
}

Findings checkResolution(double resolution_n, double rise_n) {
  if (resolution_n <= kMaxResolutionRatio * std::abs(rise_n)) return {};
  return {{Severity::kDegraded, "resolution", std::nullopt,
           "readings come in steps of " + number(resolution_n) + " N, " + percent(resolution_n / std::abs(rise_n)) +
               " of the rise",
           "only effects that are several steps large can be told; use a smaller range or a finer converter"}};
}

Findings checkQuiet(const std::optional<TimeSpan>& quiet) {
  const double quiet_s = quiet ? quiet->end_s - quiet->start_s : 0.0;
  // A tenth: the start of the lift is known no better.
  if (quiet_s > 0.9 * kMinQuietS) return {};
  return {{Severity::kDegraded, "no_quiet", std::nullopt,
           quiet ? "only " + number(quiet_s) + " s at rest before the lift, " + number(kMinQuietS) + " s are needed"
                 : "no rest before the lift",
           "the noise must be assumed, so that small effects cannot be claimed; record at least 20 s before lifting"}};
}

// ---- clock

/// Where the hoist starts or stops: the windows to look at.
struct MotionEvents {
  std::vector<TimeSpan> first_start;  ///< one or none
  std::vector<TimeSpan> others;
};

MotionEvents motionEvents(const std::vector<RecordStage>& stages) {
  MotionEvents events;
  bool started = false;
  for (std::size_t k = 0; k < stages.size(); ++k) {
    const bool is_start = isLift(stages[k]) && !started;
    started = started || isLift(stages[k]);
    if (k == 0) continue;
    const RecordStage& left = stages[k - 1];
    const RecordStage& right = stages[k];
    const auto rests = [](const RecordStage& stage) {
      return stage.kind == RecordStageKind::kHolding || stage.kind == RecordStageKind::kQuiet;
    };
    const bool starts_or_stops = (rests(left) && isLift(right)) || (isLift(left) && rests(right));
    if (!starts_or_stops || left.end_s - left.start_s < kMinEventSideS ||
        right.end_s - right.start_s < kMinEventSideS) {
      continue;
    }
    (is_start ? events.first_start : events.others)
        .push_back({std::max(left.start_s, right.start_s - kEventWindowS),
                    std::min(right.end_s, right.start_s + kEventWindowS)});
  }
  return events;
}

/// From all stops and later starts; where they tell nothing and the lift does not halt, from its first start.
std::optional<ClockOffset> clockOffset(const Samples& samples, const std::vector<RecordStage>& stages, bool has_stops) {
  const MotionEvents events = motionEvents(stages);
  const auto offset = [&](const std::vector<TimeSpan>& windows) {
    return computeClockOffset(samples.time_s, samples.force_n, samples.position_m, samples.speed_mps, windows);
  };
  std::optional<ClockOffset> clock;
  if (!events.others.empty()) {
    clock = offset(events.others);
    clock->from_stops = true;
  }
  if (clock && (has_stops || clock->sigma_s <= kMaxOffsetSigmaS)) return clock;
  return events.first_start.empty() ? clock : offset(events.first_start);
}

Findings checkClock(const std::optional<ClockOffset>& clock, bool has_stops) {
  if (!clock) return {};
  const std::string estimate = seconds(clock->offset_s) + " ± " + seconds(clock->sigma_s) + " s";
  if (clock->sigma_s > kMaxOffsetSigmaS) {
    // Where the lift does not halt, an offset only shifts the curve a little, and the fit can carry it along.
    if (!has_stops) return {};
    // A load cell that lags smears the stops: to refuse such a record would hide what it shows.
    return {{Severity::kDegraded, "clock_unknown", std::nullopt,
             "the lift has stops, but the force hardly tells when, as with noise or a load cell that lags: an offset "
             "between the clocks of force and motion is known to ± " +
                 seconds(clock->sigma_s) + " s only",
             "an offset of that size stays possible in all that follows, and hides what delays the force a little; "
             "record force and motion with one clock, or stop where the force still rises"}};
  }
  if (std::abs(clock->offset_s) < std::max(kMinOffsetS, kOffsetSigmas * clock->sigma_s)) return {};
  if (!clock->from_stops && clock->offset_s > 0.0) {
    return {
        {Severity::kNote, "late_start", std::nullopt, "the force reacts " + estimate + " after the hoist starts",
         "water between rim and ice does that, and so does an offset between the clocks; a stop during the lift would "
         "tell them apart"}};
  }
  return {{Severity::kDegraded, "clock_offset", std::nullopt,
           std::string("the force comes ") + (clock->offset_s > 0.0 ? "late" : "early") + ", by " + estimate +
               ", at starts and stops of the hoist",
           clock->offset_s > 0.0
               ? "the offset is known well enough to be taken off; a large lag of the load cell looks alike"
               : "the offset is known well enough to be taken off"}};
}

// ---- for people

const char* stageKindName(RecordStageKind kind) {
  switch (kind) {
    case RecordStageKind::kQuiet:
      return "quiet";
    case RecordStageKind::kLowering:
      return "lowering";
    case RecordStageKind::kLifting:
      return "lifting";
    case RecordStageKind::kHolding:
      return "holding";
  }
  return "unknown";
}

}  // namespace

const char* severityName(Severity severity) {
  switch (severity) {
    case Severity::kNote:
      return "note";
    case Severity::kDegraded:
      return "limit";
    case Severity::kRefuse:
      return "refused";
  }
  return "unknown";
}

Usability RecordReport::usability() const {
  Severity worst = Severity::kNote;
  for (const Finding& finding : findings) worst = std::max(worst, finding.severity);
  return worst == Severity::kRefuse     ? Usability::kNo
         : worst == Severity::kDegraded ? Usability::kWithLimits
                                        : Usability::kYes;
}

RecordReport checkRecord(const Record& record) {
  RecordReport report;
  const auto add = [&](const Findings& found) {
    report.findings.insert(report.findings.end(), found.begin(), found.end());
  };
  const std::vector<std::size_t> in_order = rowsInOrder(record.time_s);
  const Samples samples = samplesOf(record, in_order);
  report.rows = samples.row;
  add(checkTime(record, in_order));
  add(checkReadings(record));
  add(checkSampleCount(samples));
  const auto finish = [&] {
    std::stable_sort(report.findings.begin(), report.findings.end(),
                     [](const Finding& left, const Finding& right) { return left.severity > right.severity; });
    return report;
  };
  if (samples.size() < kMinSamples) return finish();

  report.start_s = samples.time_s.front();
  report.duration_s = samples.duration();
  report.rate_hz = 1.0 / samples.interval_s;
  report.stages = stagesOf(samples);
  report.resolution_n = resolutionOf(samples.reading_n);
  const std::vector<double> mean_n = runningMean(samples.time_s, samples.force_n, 1.0);
  const auto peak = std::max_element(mean_n.begin(), mean_n.end());
  report.peak_force_n = *peak;
  report.peak_time_s = samples.time_s[static_cast<std::size_t>(peak - mean_n.begin())];
  const std::optional<TimeSpan> lift = liftOf(report.stages);
  const std::optional<TimeSpan> quiet = quietOf(report.stages);
  if (lift) report.lift_m = liftLength(samples, *lift);

  const auto [lowest, highest] = std::minmax_element(samples.position_m.begin(), samples.position_m.end());
  const double travel_m = *highest - *lowest;
  const double whole_m = wholeLift(record.scenario);
  const bool position_given = record.position_given;
  const Findings constant = checkConstantForce(samples);
  add(constant);
  Findings units = checkTimeUnit(samples, travel_m, position_given);
  if (units.empty()) units = checkPositionUnit(travel_m, whole_m, position_given);
  add(units);
  // With a wrong unit of time or length, what follows would only repeat that in other words.
  if (!units.empty()) return finish();

  add(checkRate(samples));
  add(checkSpeedAgrees(samples, travel_m));
  add(checkLift(report.lift_m, whole_m));
  add(checkGaps(samples, lift.value_or(TimeSpan{samples.time_s.front(), samples.time_s.back()})));
  if (!constant.empty() || !lift || report.lift_m < kMinLiftM) return finish();

  const double white_n = whiteNoise(samples.reading_n);
  if (quiet) {
    report.noise_sigma_n =
        fitLine(samples.time_s, samples.force_n, samples.at(quiet->start_s), samples.at(quiet->end_s)).sigma;
  }
  const double sigma_n = std::fmax(report.noise_sigma_n, white_n);
  const Rise rise = riseOf(samples, mean_n, *lift, quiet);
  const double ice_weight_n = iceWeight(record.scenario);
  const Findings wrong_rise = checkRise(rise, ice_weight_n, emptyRise(record.scenario), sigma_n);
  add(wrong_rise);
  add(checkSaturation(samples, *lift, report.resolution_n, white_n));
  // Without ice, or in another unit, there is no curve to resolve.
  if (wrong_rise.empty()) add(checkResolution(report.resolution_n, rise.force_n));
  add(checkQuiet(quiet));
  report.has_stops = std::count_if(report.stages.begin(), report.stages.end(), isLift) > 1;
  report.clock = clockOffset(samples, report.stages, report.has_stops);
  add(checkClock(report.clock, report.has_stops));
  return finish();
}

std::string describe(const std::string& name, const Record& record, const RecordReport& report) {
  std::string text = name + ": record \"" + record.title + "\" (" + sourceName(record.source) + ")\n";
  const auto row = [&](const std::string& left, const std::string& right) {
    constexpr std::size_t kWidth = 10;
    text += "  " + left + std::string(left.size() < kWidth ? kWidth - left.size() : 1, ' ') + right + "\n";
  };
  if (report.rate_hz > 0.0) {
    row("samples", std::to_string(report.rows.size()) + " in " + number(report.duration_s, 4) + " s, " +
                       number(report.rate_hz) + " Hz");
    row("force", "peak " + number(report.peak_force_n, 4) + " N at " + number(report.peak_time_s, 4) +
                     " s (1 s mean, tare of " + number(record.tare_n, 4) + " N taken off)" +
                     (report.noise_sigma_n >= 0.0 ? ", noise at rest " + number(report.noise_sigma_n) + " N" : "") +
                     (report.resolution_n > 0.0 ? ", steps of " + number(report.resolution_n) + " N" : ""));
    std::string stages;
    for (const RecordStage& stage : report.stages) {
      stages += (stages.empty() ? "" : ", ") + std::string(stageKindName(stage.kind)) + " " + number(stage.start_s, 4) +
                " to " + number(stage.end_s, 4) + " s";
    }
    row("stages", stages);
    row("lift", number(report.lift_m) + " m up, position " +
                    (record.position == PositionOrigin::kMeasured ? "measured" : "commanded"));
    if (report.clock) {
      row("clock", "force " + seconds(report.clock->offset_s) + " ± " + seconds(report.clock->sigma_s) +
                       " s after the motion, from " + (report.clock->from_stops ? "stops" : "the first start only"));
    }
  }
  for (const std::string& assumption : record.assumptions) row("assumed", assumption);
  if (!record.unused_columns.empty()) {
    std::string columns;
    for (const std::string& column : record.unused_columns) columns += (columns.empty() ? "" : ", ") + column;
    row("not used", "columns " + columns);
  }
  for (const Finding& finding : report.findings) {
    std::string where;
    if (finding.row) {
      where = "line " + std::to_string(record.line[*finding.row]) + ", t = " + number(record.time_s[*finding.row], 6) +
              " s: ";
    }
    row(severityName(finding.severity), finding.code + ": " + where + finding.text);
    row("", "-> " + finding.remedy);
  }
  const Usability usability = report.usability();
  text += std::string("  usable for identification: ") +
          (usability == Usability::kYes          ? "yes"
           : usability == Usability::kWithLimits ? "with limits"
                                                 : "no") +
          "\n";
  return text;
}

}  // namespace brash_ice_rig
