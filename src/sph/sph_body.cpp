#include "brash_ice_rig/sph/sph_body.h"

#include <cassert>

#include <Eigen/LU>

#include "brash_ice_rig/sph/kernel.h"

namespace brash_ice_rig {
namespace {

// Particles per call of the material: long enough for its vector loops, short enough to stay in the first-level cache.
constexpr std::size_t kTile = 128;

/// A pair closer than this to the edge of the support has no measurable weight, and its viscosity factor overflows.
constexpr double kSupportMargin = 1.0e-4;

/// Change of volume that counts as a move, ratio.
constexpr float kVolumeChange = 0.002f;

/// Turns a symmetric tensor with the spin w of one step: t + w t - t w, written out by component.
/// @param tensor  its six arrays, in the order of material.h
void rotate(std::vector<float>* tensor, std::size_t i, float wxy, float wyz, float wzx) {
  const float xx = tensor[0][i], yy = tensor[1][i], zz = tensor[2][i];
  const float xy = tensor[3][i], yz = tensor[4][i], zx = tensor[5][i];
  tensor[0][i] = xx + 2.0f * (wxy * xy - wzx * zx);
  tensor[1][i] = yy + 2.0f * (wyz * yz - wxy * xy);
  tensor[2][i] = zz + 2.0f * (wzx * zx - wyz * yz);
  tensor[3][i] = xy + wxy * (yy - xx) - wzx * yz + wyz * zx;
  tensor[4][i] = yz + wyz * (zz - yy) - wxy * zx + wzx * xy;
  tensor[5][i] = zx + wzx * (xx - zz) - wyz * xy + wxy * yz;
}

}  // namespace

SphBody::SphBody(const SphSettings& settings, const Material& material, const std::vector<Eigen::Vector3d>& position_m,
                 const std::vector<bool>& fixed)
    : settings_(settings), material_(material), position_(position_m), fixed_(fixed.begin(), fixed.end()) {
  assert(position_m.size() == fixed.size());
  assert(settings.particle_volume_m3 > 0.0 && settings.density_kgpm3 > 0.0 && settings.smoothing_length_m > 0.0);
  const std::size_t count = position_.size();
  velocity_.assign(count, Eigen::Vector4f::Zero());
  for (auto& component : stress_) component.assign(count, 0.0f);
  for (auto& component : strain_increment_) component.assign(count, 0.0f);
  state_.assign(material.stateNames().size(), std::vector<float>(count, 0.0f));
  volume_.assign(count, static_cast<float>(settings.particle_volume_m3));
  corrected_stress_.assign(count, Matrix43f::Zero());
  viscosity_.assign(count, Eigen::Vector4f::Zero());
  row_count_.assign(count, 0);
  correction_.assign(count, Matrix43f::Zero());
  gradient_sum_.assign(count, Eigen::Vector4f::Zero());
  cached_volume_ = volume_;
  reference_ = position_;
  moved_.assign(count, 0);
  listed_.assign(count, 0);
  due_.reserve(count);
  smoothing_length_.assign(count, settings.smoothing_length_m);
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
  const double distance_squared = settings_.refresh_distance_m * settings_.refresh_distance_m;
#pragma omp for schedule(static)
  for (std::size_t i = 0; i < size(); ++i) {
    moved_[i] = (position_[i] - reference_[i]).squaredNorm() >= distance_squared ||
                std::abs(volume_[i] - cached_volume_[i]) > kVolumeChange * cached_volume_[i];
  }
#pragma omp single
  {
    due_.clear();
    for (std::size_t i = 0; i < size(); ++i) {
      if (moved_[i] != 0) takeReference(i);
    }
    // Two particles approach each other by at most twice the way of the faster one. The skin is also used up where
    // supports have grown.
    const bool first = candidates_.row_begin.empty();
    if (first || 2.0 * travelled_ + 2.0 * (longest_ - longest_at_search_) >= settings_.skin_m) {
      search();
    } else {
      listDueRows();
    }
  }
#pragma omp for schedule(static)
  for (std::size_t k = 0; k < due_.size(); ++k) refreshRow(due_[k]);
}

/// Gradients see the particle where it is now.
void SphBody::takeReference(std::size_t i) {
  reference_[i] = position_[i];
  cached_volume_[i] = volume_[i];
  if (!settings_.variable_smoothing_length) return;
  const auto rest_volume = static_cast<double>(static_cast<float>(settings_.particle_volume_m3));
  smoothing_length_[i] =
      settings_.smoothing_length_m * smoothingGrowth(static_cast<double>(cached_volume_[i]) / rest_volume);
  longest_ = std::max(longest_, smoothing_length_[i]);
}

void SphBody::search() {
  longest_ = settings_.variable_smoothing_length ? 0.0 : settings_.smoothing_length_m;
  for (std::size_t i = 0; i < size(); ++i) takeReference(i);
  findNeighbours(reference_, 2.0 * longest_ + settings_.skin_m, candidates_);
  pair_.resize(candidates_.index.size());
  neighbour_.resize(candidates_.index.size());
  longest_at_search_ = longest_;
  travelled_ = 0.0;
  due_.resize(size());
  for (std::size_t i = 0; i < size(); ++i) due_[i] = i;
}

/// A row depends on the references of its particle and of its neighbours alone: both rows of a pair hold the same
/// gradient at any time, whichever of them was refreshed.
void SphBody::listDueRows() {
  std::fill(listed_.begin(), listed_.end(), 0);
  for (std::size_t i = 0; i < size(); ++i) {
    if (moved_[i] == 0) continue;
    listed_[i] = 1;
    for (std::size_t c = candidates_.row_begin[i]; c < candidates_.row_begin[i + 1]; ++c) {
      listed_[static_cast<std::size_t>(candidates_.index[c])] = 1;
    }
  }
  for (std::size_t i = 0; i < size(); ++i) {
    if (listed_[i] != 0) due_.push_back(i);
  }
}

void SphBody::refreshRow(std::size_t i) {
  const double viscosity = settings_.density_kgpm3 * settings_.viscosity_ratio * settings_.viscosity_speed_mps;

  const std::size_t begin = candidates_.row_begin[i];
  std::size_t end = begin;
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t c = begin; c < candidates_.row_begin[i + 1]; ++c) {
    const auto j = static_cast<std::size_t>(candidates_.index[c]);
    const Eigen::Vector3d offset = reference_[i] - reference_[j];
    const double distance_squared = offset.squaredNorm();
    const double h = 0.5 * (smoothing_length_[i] + smoothing_length_[j]);  // of equal ones: exactly that one
    const CubicSpline kernel{h};
    const double reach = kernel.support() - kSupportMargin * h;
    if (distance_squared >= reach * reach || distance_squared == 0.0) continue;
    const double distance = std::sqrt(distance_squared);
    const double slope = static_cast<double>(cached_volume_[j]) * kernel.derivative(distance);
    const Eigen::Vector3d gradient = slope / distance * offset;
    const double softened = distance_squared + 0.01 * h * h;
    pair_[end].head<3>() = gradient.cast<float>();
    pair_[end].w() = static_cast<float>(viscosity * h * distance / (softened * -slope));
    neighbour_[end] = candidates_.index[c];
    ++end;
    moment.noalias() -= offset * gradient.transpose();
    sum += gradient;
  }
  row_count_[i] = static_cast<std::int32_t>(end - begin);
  gradient_sum_[i] << sum.cast<float>(), 0.0f;
  const bool regular = moment.determinant() >= settings_.determinant_limit;
  correction_[i].topRows<3>() =
      regular ? Eigen::Matrix3f(moment.inverse().cast<float>()) : Eigen::Matrix3f(Eigen::Matrix3f::Identity());
}

SphBody::Gathered SphBody::gather(std::size_t i) const {
  // Plain locals, so that the sums stay in registers.
  Eigen::Vector4f along_x = Eigen::Vector4f::Zero(), along_y = along_x, along_z = along_x, viscosity = along_x;
  const Eigen::Vector4f own = velocity_[i];
  const Eigen::Vector4f* const velocity = velocity_.data();
  const std::int32_t* const neighbour = neighbour_.data();
  const Eigen::Vector4f* const pairs = pair_.data();
  const std::size_t begin = candidates_.row_begin[i];
  const std::size_t end = begin + static_cast<std::size_t>(row_count_[i]);
  for (std::size_t n = begin; n < end; ++n) {
    const Eigen::Vector4f& pair = pairs[n];
    const Eigen::Vector4f difference = velocity[neighbour[n]] - own;
    along_x += difference * pair.x();
    along_y += difference * pair.y();
    along_z += difference * pair.z();
    viscosity += (difference.dot(pair) * pair.w()) * pair;  // difference.w is 0
  }
  viscosity.w() = 0.0f;
  Gathered result;
  result.gradient << along_x, along_y, along_z;
  result.viscosity = viscosity;
  return result;
}

Eigen::Matrix3f SphBody::velocityGradient(std::size_t i) const {
  return gather(i).gradient.topRows<3>() * correction_[i].topRows<3>();
}

void SphBody::updateStress(double time_step_s) {
  const std::size_t tiles = (size() + kTile - 1) / kTile;
#pragma omp for schedule(static)
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    updateRange(tile * kTile, std::min((tile + 1) * kTile, size()), static_cast<float>(time_step_s));
  }
}

void SphBody::updateRange(std::size_t begin, std::size_t end, float time_step_s) {
  const auto rest_volume = static_cast<float>(settings_.particle_volume_m3);
  const auto limit = static_cast<float>(settings_.volume_ratio_limit);
  const std::size_t first_tensor = state_.size() - kComponents * material_.stateTensors();
  for (std::size_t i = begin; i < end; ++i) {
    const Gathered gathered = gather(i);
    viscosity_[i] = gathered.viscosity;
    const Eigen::Matrix3f increment = time_step_s * (gathered.gradient.topRows<3>() * correction_[i].topRows<3>());

    strain_increment_[0][i] = increment(0, 0);
    strain_increment_[1][i] = increment(1, 1);
    strain_increment_[2][i] = increment(2, 2);
    strain_increment_[3][i] = 0.5f * (increment(0, 1) + increment(1, 0));
    strain_increment_[4][i] = 0.5f * (increment(1, 2) + increment(2, 1));
    strain_increment_[5][i] = 0.5f * (increment(2, 0) + increment(0, 2));
    volume_[i] = std::min(std::max(volume_[i] * (1.0f + increment.trace()), rest_volume / limit), rest_volume * limit);

    // Jaumann rate: the old stress turns with the particle.
    const float wxy = 0.5f * (increment(0, 1) - increment(1, 0));
    const float wyz = 0.5f * (increment(1, 2) - increment(2, 1));
    const float wzx = 0.5f * (increment(2, 0) - increment(0, 2));
    rotate(stress_.data(), i, wxy, wyz, wzx);
    for (std::size_t c = first_tensor; c < state_.size(); c += kComponents) rotate(&state_[c], i, wxy, wyz, wzx);
  }

  MaterialBatch batch;
  batch.count = end - begin;
  for (std::size_t c = 0; c < kComponents; ++c) {
    batch.strain_increment[c] = strain_increment_[c].data() + begin;
    batch.stress[c] = stress_[c].data() + begin;
  }
  batch.state.reserve(state_.size());
  for (auto& values : state_) batch.state.push_back(values.data() + begin);
  material_.update(batch);

  for (std::size_t i = begin; i < end; ++i) {
    Eigen::Matrix3f stress;
    stress << stress_[0][i], stress_[3][i], stress_[5][i],  //
        stress_[3][i], stress_[1][i], stress_[4][i],        //
        stress_[5][i], stress_[4][i], stress_[2][i];
    corrected_stress_[i].topRows<3>() = stress * correction_[i].topRows<3>();
  }
}

Eigen::Vector4f SphBody::internalForce(std::size_t i) const {
  const Matrix43f* const stress = corrected_stress_.data();
  const std::int32_t* const neighbour = neighbour_.data();
  const Eigen::Vector4f* const pairs = pair_.data();
  const std::size_t begin = candidates_.row_begin[i];
  const std::size_t end = begin + static_cast<std::size_t>(row_count_[i]);
  Eigen::Vector4f sum = viscosity_[i];
  sum += corrected_stress_[i] * gradient_sum_[i].head<3>();
  for (std::size_t n = begin; n < end; ++n) {
    const Eigen::Vector4f& pair = pairs[n];
    const Matrix43f& other = stress[neighbour[n]];
    sum += other.col(0) * pair.x() + other.col(1) * pair.y() + other.col(2) * pair.z();
  }
  return cached_volume_[i] * sum;
}

}  // namespace brash_ice_rig
