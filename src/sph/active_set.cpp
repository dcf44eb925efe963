#include "brash_ice_rig/sph/active_set.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace brash_ice_rig {

ActiveSet::ActiveSet(const ActiveSetSettings& settings, const std::vector<Eigen::Vector3d>& position_m,
                     const std::vector<bool>& fixed)
    : settings_(settings), fixed_(fixed.begin(), fixed.end()), awake_count_(fixed.size()) {
  const std::size_t count = fixed.size();
  group_awake_.assign((count + kGroup - 1) / kGroup, 1);
  group_row_.assign(group_awake_.size() + 1, 0);
  lowest_neighbour_.assign(group_awake_.size(), 0);  // until they are known, each run may be another's neighbour
  highest_neighbour_.assign(group_awake_.size(), group_awake_.size() - 1);
  largest_force_ = static_cast<float>(settings.quiet_force_n);
  makeRuns();
  if (!settings.enabled) return;
  assert(settings.quiet_force_n > 0.0 && settings.quiet_way_m > 0.0 && settings.quiet_time_s > 0.0);
  assert(settings.spacing_m > 0.0 && settings.time_step_s > 0.0);
  sample_steps_ =
      std::max(kShortestSample, static_cast<std::uint64_t>(std::llround(kSamplePeriod / settings.time_step_s)));
  window_steps_ = kSamples * sample_steps_;
  const double window_s = static_cast<double>(window_steps_) * settings.time_step_s;
  quiet_windows_ = static_cast<std::uint64_t>(std::ceil(settings.quiet_time_s / window_s));
  quiet_for_.assign(group_awake_.size(), 0);
  stress_sum_.assign(count, Stress{});
  anchor_stress_ = stress_sum_;
  anchor_position_ = position_m;
  pushed_.assign(count, 0);
}

void ActiveSet::setNeighbours(const NeighbourList& neighbours) {
  std::vector<std::size_t> last_seen(group_awake_.size(), group_awake_.size());
  group_neighbour_.clear();
  for (std::size_t group = 0; group < group_awake_.size(); ++group) {
    const std::size_t begin = neighbours.row_begin[group * kGroup], end = neighbours.row_begin[groupEnd(group)];
    lowest_neighbour_[group] = highest_neighbour_[group] = group;
    for (std::size_t c = begin; c < end; ++c) {
      const std::size_t other = static_cast<std::size_t>(neighbours.index[c]) / kGroup;
      if (last_seen[other] == group) continue;
      last_seen[other] = group;
      group_neighbour_.push_back(other);
      lowest_neighbour_[group] = std::min(lowest_neighbour_[group], other);
      highest_neighbour_[group] = std::max(highest_neighbour_[group], other);
    }
    group_row_[group + 1] = group_neighbour_.size();
  }
  makeRuns();
}

void ActiveSet::endStep(const std::vector<Eigen::Vector3d>& position_m, const Eigen::Vector2d& axis_m, double radius_m,
                        std::vector<std::size_t>& fallen_asleep) {
  fallen_asleep.clear();
  if (!settings_.enabled) return;
  ++step_;
  bool changed = woken_;
  woken_ = false;
  if (sampling_) changed = wakePushed() || changed;
  if (step_ % window_steps_ == 0) changed = letSleep(position_m, axis_m, radius_m, fallen_asleep) || changed;
  if (changed) makeRuns();
  sampling_ = (step_ + 1) % sample_steps_ == 0;
}

/// Groups that are pushed, and those around them: what comes next meets ice that is awake.
bool ActiveSet::wakePushed() {
  bool changed = false;
  const auto wakeGroup = [&](std::size_t group) {
    if (group_awake_[group] != 0) return;
    group_awake_[group] = 1;
    quiet_for_[group] = 0;
    changed = true;
  };
  for (const Run& run : border_) {
    for (std::size_t i = run.begin; i < run.end; ++i) {
      if (pushed_[i] == 0) continue;
      pushed_[i] = 0;
      const std::size_t group = i / kGroup;
      wakeGroup(group);
      for (std::size_t n = group_row_[group]; n < group_row_[group + 1]; ++n) wakeGroup(group_neighbour_[n]);
    }
  }
  return changed;
}

/// Groups that have been quiet for long enough; and what the rig may touch soon wakes up.
bool ActiveSet::letSleep(const std::vector<Eigen::Vector3d>& position_m, const Eigen::Vector2d& axis_m, double radius_m,
                         std::vector<std::size_t>& fallen_asleep) {
  bool changed = false;
  const double radius_squared = radius_m * radius_m;
  for (std::size_t group = 0; group < group_awake_.size(); ++group) {
    const std::size_t begin = group * kGroup, end = groupEnd(group);
    bool near = false, quiet = true;
    for (std::size_t i = begin; i < end; ++i) {
      near = near || (position_m[i].head<2>() - axis_m).squaredNorm() < radius_squared;
    }
    if (group_awake_[group] == 0) {
      if (!near) continue;
      group_awake_[group] = 1;
      quiet_for_[group] = 0;
      changed = true;
      continue;
    }
    for (std::size_t i = begin; i < end; ++i) quiet = quiet && isQuiet(i, position_m[i]);
    if (!quiet || quiet_for_[group] == 0) {
      quiet_for_[group] = quiet ? 1 : 0;
      for (std::size_t i = begin; i < end; ++i) setAnchor(i, position_m[i]);
    } else if (++quiet_for_[group] > quiet_windows_ && !near) {
      group_awake_[group] = 0;
      changed = true;
      for (std::size_t i = begin; i < end; ++i) fallen_asleep.push_back(i);
    }
    for (std::size_t i = begin; i < end; ++i) stress_sum_[i] = Stress{};
  }
  return changed;
}

/// Near the anchor in place and in mean stress.
bool ActiveSet::isQuiet(std::size_t i, const Eigen::Vector3d& position_m) const {
  const double way = settings_.quiet_way_m;
  if (!((position_m - anchor_position_[i]).squaredNorm() <= way * way)) return false;
  const auto largest = static_cast<float>(settings_.quiet_force_n / (settings_.spacing_m * settings_.spacing_m));
  for (std::size_t c = 0; c < kComponents; ++c) {
    const float mean = stress_sum_[i][c] / static_cast<float>(kSamples);
    if (!(std::abs(mean - anchor_stress_[i][c]) <= largest)) return false;
  }
  return true;
}

void ActiveSet::setAnchor(std::size_t i, const Eigen::Vector3d& position_m) {
  anchor_position_[i] = position_m;
  for (std::size_t c = 0; c < kComponents; ++c) {
    anchor_stress_[i][c] = stress_sum_[i][c] / static_cast<float>(kSamples);
  }
}

void ActiveSet::makeRuns() {
  const auto collect = [this](const std::vector<char>& wanted, std::vector<Run>& runs) {
    runs.clear();
    for (std::size_t group = 0; group < wanted.size(); ++group) {
      if (wanted[group] == 0) continue;
      const std::size_t begin = group * kGroup, end = groupEnd(group);
      if (!runs.empty() && runs.back().end == begin && end - runs.back().begin <= kLongestRun) {
        runs.back().end = end;
      } else {
        runs.push_back({begin, end, 0, 0});
      }
    }
  };
  collect(group_awake_, awake_);
  awake_count_ = 0;
  for (const Run& run : awake_) awake_count_ += run.end - run.begin;
  findNeighbourRuns();

  border_group_.assign(group_awake_.size(), 0);
  for (std::size_t group = 0; group < group_awake_.size(); ++group) {
    if (group_awake_[group] != 0) continue;
    for (std::size_t n = group_row_[group]; n < group_row_[group + 1]; ++n) {
      if (group_awake_[group_neighbour_[n]] != 0) border_group_[group] = 1;
    }
  }
  collect(border_group_, border_);
}

void ActiveSet::findNeighbourRuns() {
  // For each group the first run that ends beyond it, and from behind the last that begins before it.
  const std::size_t groups = group_awake_.size(), runs = awake_.size();
  std::vector<std::size_t> run_from(groups), run_to(groups);
  for (std::size_t group = 0, run = 0; group < groups; ++group) {
    while (run < runs && awake_[run].end <= group * kGroup) ++run;
    run_from[group] = run;
  }
  for (std::size_t group = groups, run = runs; group-- > 0;) {
    while (run > 0 && awake_[run - 1].begin >= groupEnd(group)) --run;
    run_to[group] = run;  // one beyond
  }
  completed_begin_.assign(runs + 1, 0);
  for (std::size_t r = 0; r < runs; ++r) {
    Run& run = awake_[r];
    run.first_neighbour = run.last_neighbour = r;
    for (std::size_t group = run.begin / kGroup; group * kGroup < run.end; ++group) {
      run.first_neighbour = std::min(run.first_neighbour, run_from[lowest_neighbour_[group]]);
      run.last_neighbour = std::max(run.last_neighbour, run_to[highest_neighbour_[group]] - 1);
    }
    ++completed_begin_[run.last_neighbour + 1];
  }
  for (std::size_t r = 0; r < runs; ++r) completed_begin_[r + 1] += completed_begin_[r];
  completed_.resize(runs);
  std::vector<std::size_t> cursor(completed_begin_.begin(), completed_begin_.end() - 1);
  for (std::size_t r = 0; r < runs; ++r) completed_[cursor[awake_[r].last_neighbour]++] = r;
}

ActiveSet::Share ActiveSet::share(std::size_t index, std::size_t count) const {
  // A run belongs to the share in which its first particle is.
  const auto bound = [&](std::size_t k) {
    std::size_t run = 0;
    for (std::size_t before = 0; run < awake_.size() && before * count < awake_count_ * k; ++run) {
      before += awake_[run].end - awake_[run].begin;
    }
    return run;
  };
  return {bound(index), index + 1 == count ? awake_.size() : bound(index + 1)};
}

void ActiveSet::visitState(StateVisitor& visitor, const NeighbourList& neighbours) {
  const auto takeNeighbours = [&] {
    if (neighbours.row_begin.empty()) {
      makeRuns();
    } else {
      setNeighbours(neighbours);
    }
  };
  if (!settings_.enabled) {  // nothing ever changes
    if (visitor.loading()) takeNeighbours();
    return;
  }
  visitor("step", step_);
  visitor("sampling", sampling_);
  visitor("woken", woken_);
  visitor("group_awake", group_awake_);
  visitor("quiet_for", quiet_for_);
  visitor.records("stress_sum_pa", stress_sum_);
  visitor.records("anchor_stress_pa", anchor_stress_);
  visitor.records("anchor_position_m", anchor_position_);
  visitor("pushed", pushed_);
  // The runs lag behind what wake() has woken.
  std::vector<char> in_runs(group_awake_.size(), 0);
  for (const Run& run : awake_) {
    for (std::size_t i = run.begin; i < run.end; i += kGroup) in_runs[i / kGroup] = 1;
  }
  visitor("in_runs", in_runs);
  if (!visitor.loading()) return;
  group_awake_.swap(in_runs);
  takeNeighbours();
  group_awake_.swap(in_runs);
}

}  // namespace brash_ice_rig
