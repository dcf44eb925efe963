#include "brash_ice_rig/sph/sph_body.h"

#include <cassert>
#include <cmath>

#include <omp.h>

#include "brash_ice_rig/math/repeatable.h"
#include "brash_ice_rig/sph/kernel.h"
#include "brash_ice_rig/system/hash.h"

namespace brash_ice_rig {

extern const SphKernels kSphKernels_baseline;
#ifdef BRASH_ICE_X86_KERNELS
extern const SphKernels kSphKernels_avx2, kSphKernels_avx512;
#endif

const SphKernels& sphKernels([[maybe_unused]] InstructionSet set) {
#ifdef BRASH_ICE_X86_KERNELS
  if (set == InstructionSet::kAvx512) return kSphKernels_avx512;
  if (set == InstructionSet::kAvx2) return kSphKernels_avx2;
#endif
  return kSphKernels_baseline;
}

namespace {

/// Change of volume that counts as a move, ratio.
constexpr float kVolumeChange = 0.002f;

/// Share of the way that counts as a move which particles may go between two looks at them.
constexpr double kUncheckedShare = 0.1;
/// Ice with more particles in a place than this many lattices is a crowd, see spreadCrowds().
constexpr double kCrowd = 1.5;
/// Who has fewer neighbours than so many within this share of a spacing is in none: the lattice has none there, a crowd
/// at least as many. It spares almost all particles the look at their concentration.
constexpr double kClose = 0.95;
constexpr int kCloseInCrowd = 2;
/// Shifting of its particles, in h² per search, and at most so far, in h.
constexpr double kSpreading = 0.5, kLargestSpread = 0.05;

/// How far particles may go before their gradients see no more of it, over the size of the field.
constexpr double kSiteRange = 4.0;

Padded3* padded(AlignedVector<Eigen::Vector4f>& vectors) {
  return reinterpret_cast<Padded3*>(vectors.data());
}

}  // namespace

SphBody::SphBody(const SphSettings& settings, const Material& material, const std::vector<Eigen::Vector3d>& position_m,
                 const std::vector<bool>& fixed)
    : settings_(settings),
      material_(material),
      kernels_(sphKernels(chosenInstructionSet())),
      position_(position_m),
      fixed_(fixed.begin(), fixed.end()),
      active_(settings.active_set, position_m, fixed) {
  assert(position_m.size() == fixed.size());
  assert(settings.particle_volume_m3 > 0.0 && settings.density_kgpm3 > 0.0 && settings.smoothing_length_m > 0.0);
  const std::size_t count = position_.size();
  velocity_.assign(count, Eigen::Vector4f::Zero());
  for (auto& component : stress_) component.assign(count, 0.0f);
  for (auto& component : strain_increment_) component.assign(count, 0.0f);
  state_.assign(material.stateNames().size(), std::vector<float>(count, 0.0f));
  volume_.assign(count, static_cast<float>(settings.particle_volume_m3));
  const std::size_t turning = kComponents * material.stateTensors();
  for (std::size_t c = state_.size() - turning; c < state_.size(); ++c) tensors_.push_back(state_[c].data());
  corrected_stress_.assign(count, CorrectedStress{});
  viscosity_.assign(count, Eigen::Vector4f::Zero());
  force_.assign(count, Eigen::Vector4f::Zero());
  block_begin_.assign(count + 1, 0);
  block_count_.assign(count, 0);
  for (auto& component : correction_) component.assign(count, 0.0f);
  gradient_sum_.assign(count, Eigen::Vector4f::Zero());
  cached_volume_ = volume_;
  reference_ = position_;
  longest_ = settings.smoothing_length_m;
  searched_position_ = position_;
  moved_.assign(count, kStays);
  listed_.assign(count, 0);
  due_.reserve(count);
  square_sums_.assign(count, 0.0f);
  odd_growth_.assign(count, 0);
  smoothing_length_.assign(count, settings.smoothing_length_m);
  double farthest = settings.smoothing_length_m;
  for (const Eigen::Vector3d& position : position_m) farthest = std::max(farthest, position.cwiseAbs().maxCoeff());
  // The power of two at or above the range, by 2^-30.
  int exponent = 0;
  const double fraction = std::frexp(kSiteRange * farthest, &exponent);
  site_unit_m_ = std::ldexp(1.0, (fraction > 0.5 ? exponent : exponent - 1) - 30);
  site_.resize(count);
  for (std::size_t i = 0; i < count; ++i) setSite(i);
}

void SphBody::setVelocity(std::size_t i, const Eigen::Vector3d& velocity_mps) {
  velocity_[i].head<3>() = velocity_mps.cast<float>();
}

void SphBody::setStress(std::size_t i, const std::array<float, kComponents>& stress_pa) {
  for (std::size_t c = 0; c < kComponents; ++c) stress_[c][i] = stress_pa[c];
}

void SphBody::setVolume(std::size_t i, double volume_m3) {
  volume_[i] = static_cast<float>(volume_m3);
  cached_volume_[i] = volume_[i];
}

void SphBody::updateGradients() {
  const bool first = candidates_.row_begin.empty();
  if (!first && unchecked_way_ < kUncheckedShare * settings_.refresh_distance_m) return;
  checkMoves();
#pragma omp single
  {
    unchecked_way_ = 0.0;
    due_.clear();
    if (any_moved_) takeReferences();
    // Two particles approach each other by at most twice the way of the one that went farther. The skin is also used up
    // where supports have grown, and until the next look.
    const double used =
        std::sqrt(farthest_squared_) + (longest_ - longest_at_search_) + kUncheckedShare * settings_.refresh_distance_m;
    search_due_ = first || 2.0 * used >= settings_.skin_m;
    if (search_due_ && settings_.variable_smoothing_length) {
      longest_ = *std::max_element(smoothing_length_.begin(), smoothing_length_.end());
    }
  }
  if (search_due_) {
    search_.find(reference_, 2.0 * longest_ + settings_.skin_m, candidates_);
    spreadCrowds();
  }
#pragma omp single
  {
    if (search_due_) takeCandidates();
    if (first) {
      listAllRows();  // there is room for none until their lengths are known
    } else if (any_moved_) {
      listDueRows();
    }
    any_moved_ = false;
    farthest_squared_ = 0.0;
  }
  refreshDueRows();
  if (!row_overflows_) return;
#pragma omp barrier
#pragma omp single
  makeRoomForRows();
  refreshDueRows();
}

/// Who has left its reference, and how far particles have gone since the candidates were found.
void SphBody::checkMoves() {
  const double distance_squared = settings_.refresh_distance_m * settings_.refresh_distance_m;
  bool any_moved = false;
  double farthest_squared = 0.0;
#pragma omp for schedule(static) nowait
  for (std::size_t i = 0; i < size(); ++i) {
    const double way_squared = (position_[i] - reference_[i]).squaredNorm();
    const float swelling = std::abs(volume_[i] - cached_volume_[i]);
    const bool moved = way_squared >= distance_squared || swelling > kVolumeChange * cached_volume_[i];
    moved_[i] = moved ? kMoved : 4.0 * way_squared >= distance_squared ? kHalfMoved : kStays;
    any_moved = any_moved || moved;
    farthest_squared = std::max(farthest_squared, (position_[i] - searched_position_[i]).squaredNorm());
  }
#pragma omp critical(brash_ice_rig_sph_moves)
  {
    any_moved_ = any_moved_ || any_moved;
    farthest_squared_ = std::max(farthest_squared_, farthest_squared);
  }
#pragma omp barrier
}

/// From now on gradients see those that have moved where they are now. Neighbours of such a particle which are half on
/// their way are taken along, or a body in motion would be refreshed bit by bit, each row again for each of its
/// neighbours.
void SphBody::takeReferences() {
  if (!candidates_.row_begin.empty()) {
    for (std::size_t i = 0; i < size(); ++i) {
      if (moved_[i] != kMoved) continue;
      forCandidates(i, [this](std::size_t j) {
        if (moved_[j] == kHalfMoved) moved_[j] = kTakenAlong;
      });
    }
  }
  const auto rest_volume = static_cast<double>(static_cast<float>(settings_.particle_volume_m3));
  for (std::size_t i = 0; i < size(); ++i) {
    if (moved_[i] < kTakenAlong) continue;
    reference_[i] = position_[i];
    cached_volume_[i] = volume_[i];
    if (settings_.variable_smoothing_length) {
      smoothing_length_[i] =
          settings_.smoothing_length_m * smoothingGrowth(static_cast<double>(cached_volume_[i]) / rest_volume);
      longest_ = std::max(longest_, smoothing_length_[i]);
    }
    setSite(i);
  }
}

/// After a search where the references are. Rows hold their neighbours already and stay as they are.
void SphBody::takeCandidates() {
  active_.setNeighbours(candidates_);
  searched_position_ = reference_;
  longest_at_search_ = longest_;
  findLongestRow();
}

/// Strain from a smoothed velocity does not see two particles pass through each other, so that broken ice which is
/// pressed for long, by a net that folds around it, would shrink to a point. After a search, particles of a crowd are
/// shifted down the gradient of the concentration c_i = V_0 sum_j W_ij, as in Lind, Xu, Stansby and Rogers (2012,
/// Journal of Computational Physics 231), but keep their velocity. In a lift it stays below 1.2, and nothing
/// changes.
void SphBody::spreadCrowds() {
  const double h = settings_.smoothing_length_m;
  const CubicSpline kernel{h};
  const double close_m = kClose * repeatable::cbrt(settings_.particle_volume_m3);
  bool any = false;
#pragma omp for schedule(static)
  for (std::size_t i = 0; i < size(); ++i) {
    if (fixed_[i] != 0 || !active_.isAwake(i)) continue;
    int close = 0;
    forCandidates(i, [&](std::size_t j) {
      close += static_cast<int>((reference_[i] - reference_[j]).squaredNorm() < close_m * close_m);
    });
    if (close < kCloseInCrowd) continue;
    double sum = kernel.value(0.0);
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    forCandidates(i, [&](std::size_t j) {
      const Eigen::Vector3d away = reference_[i] - reference_[j];
      const double distance = away.norm();
      sum += kernel.value(distance);
      if (distance > 0.0) gradient += kernel.derivative(distance) / distance * away;
    });
    if (sum * settings_.particle_volume_m3 <= kCrowd) continue;
    Eigen::Vector3d shift = -kSpreading * h * h * settings_.particle_volume_m3 * gradient;
    const double length = shift.norm();
    if (length > kLargestSpread * h) shift *= kLargestSpread * h / length;
    position_[i] += shift;
    any = true;
  }
  if (!any) return;
#pragma omp atomic write
  unchecked_way_ = kLargestSpread * h;
}

void SphBody::findLongestRow() {
  longest_row_ = 0;
  for (std::size_t i = 0; i < size(); ++i) {
    longest_row_ = std::max(longest_row_, candidates_.row_begin[i + 1] - candidates_.row_begin[i]);
  }
}

/// Packs the rows: what lies between them would be read along with them. One block is left free in each for ice that is
/// compacted, so that this is seldom done again.
void SphBody::makeRoomForRows() {
  for (std::size_t i = 0; i < size(); ++i) {
    block_begin_[i + 1] = block_begin_[i] + static_cast<std::size_t>(block_count_[i]) + 1;
  }
  blocks_.resize(block_begin_.back());
  listAllRows();
  row_overflows_ = false;
}

void SphBody::listAllRows() {
  due_.resize(size());
  for (std::size_t i = 0; i < size(); ++i) due_[i] = i;
}

/// A row depends on the references of its particle and of its neighbours alone: both rows of a pair hold the same
/// gradient at any time, whichever of them was refreshed.
void SphBody::listDueRows() {
  std::fill(listed_.begin(), listed_.end(), 0);
  for (std::size_t i = 0; i < size(); ++i) {
    if (moved_[i] < kTakenAlong) continue;
    listed_[i] = 1;
    forCandidates(i, [this](std::size_t j) { listed_[j] = 1; });
  }
  for (std::size_t i = 0; i < size(); ++i) {
    if (listed_[i] != 0) due_.push_back(i);
  }
}

void SphBody::refreshDueRows() {
  SphSites sites;
  sites.site = site_.data();
  sites.volume = cached_volume_.data();
  sites.unit_m = static_cast<float>(site_unit_m_);
  sites.viscosity =
      static_cast<float>(settings_.density_kgpm3 * settings_.viscosity_ratio * settings_.viscosity_speed_mps);
  std::vector<std::int32_t> scratch(longest_row_ + 2 * PairBlock::kPairs);
  bool overflows = false;
#pragma omp for schedule(static) nowait
  for (std::size_t k = 0; k < due_.size(); ++k) {  // NOLINT(modernize-loop-convert): for OpenMP
    overflows = !refreshRow(sites, due_[k], scratch.data()) || overflows;
  }
#pragma omp critical(brash_ice_rig_sph_rows)
  row_overflows_ = row_overflows_ || overflows;
#pragma omp barrier
}

/// @param scratch  room for two blocks more than the longest row has candidates
/// @return whether there was room for it among blocks_; its length is noted in any case
bool SphBody::refreshRow(const SphSites& sites, std::size_t i, std::int32_t* scratch) {
  const std::size_t first = candidates_.row_begin[i], room = block_begin_[i + 1] - block_begin_[i];
  double m[6], viscosity = 0.0;
  block_count_[i] =
      kernels_.refresh(sites, i, candidates_.index.data() + first, candidates_.row_begin[i + 1] - first, scratch,
                       blocks_.data() + block_begin_[i], room, padded(gradient_sum_) + i, m, &viscosity);
  if (static_cast<std::size_t>(block_count_[i]) > room) return false;
  // A pair goes without the larger share of its two particles, so that its forces stay antisymmetric.
  const double viscous_rate = viscosity * static_cast<double>(cached_volume_[i]) / particleMass();
  const double allowed = settings_.largest_viscous_rate_ps;
  velocity_[i].w() = viscous_rate > allowed ? static_cast<float>(1.0 - allowed / viscous_rate) : 0.0f;
  // M is symmetric: its inverse is that of its cofactors over its determinant.
  const double xx = m[1] * m[2] - m[4] * m[4], yy = m[0] * m[2] - m[5] * m[5], zz = m[0] * m[1] - m[3] * m[3];
  const double xy = m[4] * m[5] - m[3] * m[2], yz = m[3] * m[5] - m[4] * m[0], zx = m[3] * m[4] - m[5] * m[1];
  const double determinant = m[0] * xx + m[3] * xy + m[5] * zx;
  const bool regular = determinant >= settings_.determinant_limit;
  const double factor = regular ? 1.0 / determinant : 0.0, unit = regular ? 0.0 : 1.0;
  const double correction[9] = {unit + factor * xx, factor * xy, factor * zx, factor * xy,       unit + factor * yy,
                                factor * yz,        factor * zx, factor * yz, unit + factor * zz};
  for (std::size_t c = 0; c < 9; ++c) correction_[c][i] = static_cast<float>(correction[c]);
  return true;
}

/// Whole numbers of a unit so fine that nothing is lost to what the difference of two can be in float, and so large
/// that the field fits in several times; what flies off farther than that has no neighbours any more.
void SphBody::setSite(std::size_t i) {
  const auto whole = [this](double x_m) {
    constexpr double kFarthest = 1.0e9;  // differences of two stay in range
    return static_cast<std::int32_t>(std::lround(std::clamp(x_m / site_unit_m_, -kFarthest, kFarthest)));
  };
  site_[i] = {whole(reference_[i].x()), whole(reference_[i].y()), whole(reference_[i].z()),
              static_cast<float>(smoothing_length_[i])};
}

SphRows SphBody::rows() {
  SphRows rows{};
  rows.blocks = blocks_.data();
  rows.block_begin = block_begin_.data();
  rows.block_count = block_count_.data();
  rows.velocity = padded(velocity_);
  for (std::size_t c = 0; c < 9; ++c) rows.correction[c] = correction_[c].data();
  rows.gradient_sum = padded(gradient_sum_);
  rows.cached_volume = cached_volume_.data();
  for (std::size_t c = 0; c < kComponents; ++c) {
    rows.strain_increment[c] = strain_increment_[c].data();
    rows.stress[c] = stress_[c].data();
  }
  rows.tensors = tensors_.data();
  rows.tensor_count = tensors_.size() / kComponents;
  rows.volume = volume_.data();
  rows.corrected_stress = corrected_stress_.data();
  rows.viscosity = padded(viscosity_);
  rows.force = padded(force_);
  return rows;
}

Eigen::Matrix3f SphBody::velocityGradient(std::size_t i) const {
  Eigen::Matrix<float, 3, 3, Eigen::RowMajor> gradient;
  // rows() hands out what the sweeps write as well; this kernel only reads.
  kernels_.velocityGradient(const_cast<SphBody*>(this)->rows(), i, gradient.data());
  return gradient;
}

void SphBody::updateStress(double time_step_s) {
  const SphRows rows = this->rows();
  const auto& awake = active_.awake();
  const auto& watched = active_.watched();
  const ActiveSet::Share share = ownShare();
  // A force needs the stress of all neighbours. It is computed as soon as the last of them is known, when the row is
  // still in the cache from its first use; where another thread has neighbours, after all are known.
  const auto computeForce = [&](std::size_t run) { kernels_.force(rows, awake[run].begin, awake[run].end); };
  for (std::size_t run = share.begin; run < share.end; ++run) {
    odd_growth_[run] = updateRun(rows, awake[run], static_cast<float>(time_step_s)) ? 0 : 1;
    active_.forRunsCompletedBy(run, [&](std::size_t completed) {
      if (share.holds(completed, awake[completed])) computeForce(completed);
    });
  }
#pragma omp barrier
  for (std::size_t run = share.begin; run < share.end; ++run) {
    if (!share.holds(run, awake[run])) computeForce(run);
  }
#pragma omp for schedule(static) nowait
  for (std::size_t run = 0; run < watched.size(); ++run)  // NOLINT(modernize-loop-convert): for OpenMP
    kernels_.force(rows, watched[run].begin, watched[run].end);
}

ActiveSet::Share SphBody::ownShare() const {
  return active_.share(static_cast<std::size_t>(omp_get_thread_num()), static_cast<std::size_t>(omp_get_num_threads()));
}

/// @return whether all volumes grow within bounds
bool SphBody::updateRun(const SphRows& rows, const ActiveSet::Run& run, float time_step_s) {
  const std::size_t begin = run.begin, end = run.end;
  const auto rest_volume = static_cast<float>(settings_.particle_volume_m3);
  const auto limit = static_cast<float>(settings_.volume_ratio_limit);
  kernels_.strain(rows, begin, end, time_step_s, rest_volume / limit, rest_volume * limit);
  MaterialBatch batch;
  batch.count = end - begin;
  for (std::size_t c = 0; c < kComponents; ++c) {
    batch.strain_increment[c] = strain_increment_[c].data() + begin;
    batch.stress[c] = stress_[c].data() + begin;
  }
  batch.state.reserve(state_.size());
  for (auto& values : state_) batch.state.push_back(values.data() + begin);
  material_.update(batch);
  kernels_.correctStress(rows, begin, end);
  // Here, where they are in the cache, and without a branch.
  int beyond = 0;
  for (std::size_t i = begin; i < end; ++i) beyond += growsWithinBounds(i) ? 0 : 1;
  return beyond == 0;
}

void SphBody::updateActiveSet() {
  active_.endStep(position_, awake_axis_, awake_radius_, fallen_asleep_);
  for (const std::size_t i : fallen_asleep_) {
    velocity_[i].head<3>().setZero();
    viscosity_[i].setZero();
  }
}

void SphBody::clearNonFinite() {
  const auto clear = [](std::vector<float>& values, float otherwise) {
    for (float& value : values) {
      if (!std::isfinite(value)) value = otherwise;
    }
  };
  for (auto& component : stress_) clear(component, 0.0f);
  for (auto& values : state_) clear(values, 0.0f);
  clear(volume_, static_cast<float>(settings_.particle_volume_m3));
}

void SphBody::visitState(StateVisitor& visitor) {
  visitor.records("position_m", position_);
  visitor.records("velocity_mps", velocity_);
  visitor("stress_pa", stress_);
  for (auto& values : state_) visitor("state", values);
  visitor("volume_m3", volume_);
  visitor("inertia_ratio", inertia_ratio_);
  visitor.records("viscosity_npm3", viscosity_);
  visitor.records("corrected_stress_pa", corrected_stress_);  // those that sleep keep theirs
  visitor.records("reference_m", reference_);
  visitor("cached_volume_m3", cached_volume_);
  visitor("smoothing_length_m", smoothing_length_);
  visitor.records("searched_position_m", searched_position_);
  visitor("longest_m", longest_);
  visitor("longest_at_search_m", longest_at_search_);
  visitor("unchecked_way_m", unchecked_way_);
  visitor("awake_axis_m", awake_axis_);
  visitor("awake_radius_m", awake_radius_);
  bool searched = !candidates_.row_begin.empty();
  visitor("searched", searched);
  if (visitor.loading()) {
    checkLoaded(visitor);
    if (searched) rebuildRows();
  }
  const std::uint64_t present_rows = hashOfRows();
  std::uint64_t rows = present_rows;
  visitor("rows", rows);
  if (rows != present_rows) visitor.refuse("this program computes other gradients than the one that wrote it");
  // They follow from the references like the rows: whatever search a row was computed after, its order is the same.
  visitor("correction", correction_);
  visitor.records("gradient_sum_pm", gradient_sum_);
  active_.visitState(visitor, candidates_);
}

void SphBody::checkLoaded(const StateVisitor& visitor) const {
  // Longer than any that can be; a search in between may use a longest one that is out of date.
  const double longest = settings_.smoothing_length_m * (settings_.variable_smoothing_length ? 2.0 : 1.0);
  const auto isLength = [&](double length) { return length > 0.0 && length <= longest; };
  if (!isLength(longest_) || !(longest_at_search_ >= 0.0 && longest_at_search_ <= longest)) {
    visitor.refuse("a smoothing length is out of range");
  }
  const double cell_size = 2.0 * longest + settings_.skin_m;
  std::vector<std::array<std::int64_t, 3>> cells;
  cells.reserve(size());
  for (std::size_t i = 0; i < size(); ++i) {
    if (!position_[i].allFinite() || !reference_[i].allFinite() || !searched_position_[i].allFinite() ||
        !velocity_[i].allFinite()) {
      visitor.refuse("a position or velocity is not finite");
    }
    if (!(volume_[i] > 0.0f && cached_volume_[i] > 0.0f) || !isLength(smoothing_length_[i])) {
      visitor.refuse("a volume or smoothing length is out of range");
    }
    std::array<std::int64_t, 3> cell{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double along = std::floor(searched_position_[i][static_cast<Eigen::Index>(axis)] / cell_size);
      cell[axis] = static_cast<std::int64_t>(std::clamp(along, -1.0e15, 1.0e15));
    }
    cells.push_back(cell);
  }
  // Memory for neighbours is planned for ice as dense as its lattice. Volumes keep it from becoming many times denser.
  constexpr double kDensest = 8.0;
  const double sites = std::ceil(cell_size / repeatable::cbrt(settings_.particle_volume_m3));
  const auto most = static_cast<std::size_t>(kDensest * sites * sites * sites);
  std::sort(cells.begin(), cells.end());
  for (std::size_t i = most; i < cells.size(); ++i) {
    if (cells[i] == cells[i - most]) visitor.refuse("particles lie denser than ice can be");
  }
}

std::uint64_t SphBody::hashOfRows() const {
  Hash hash;
  for (std::size_t i = 0; i < size(); ++i) {
    const auto count = static_cast<std::size_t>(block_count_[i]);
    if (count > 0) hash.add(blocks_.data() + block_begin_[i], count * sizeof(PairBlock));
  }
  return hash.value();
}

/// Candidates as they were found, and rows from the references, which kernels read as sites.
void SphBody::rebuildRows() {
  for (std::size_t i = 0; i < size(); ++i) setSite(i);
  search_.find(searched_position_, 2.0 * longest_at_search_ + settings_.skin_m, candidates_);
  findLongestRow();
  listAllRows();
  refreshDueRows();
  if (!row_overflows_) return;
  makeRoomForRows();
  refreshDueRows();
}

}  // namespace brash_ice_rig
