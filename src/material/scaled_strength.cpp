#include "brash_ice_rig/material/scaled_strength.h"

#include <algorithm>
#include <cassert>

namespace brash_ice_rig {
namespace {

constexpr std::size_t kTile = 128;  // copies of a tile stay in the first cache

float strengthRatio(float surplus) {
  return std::max(1.0f + surplus, ScaledStrength::kLeastRatio);
}

bool endsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

ScaledStrength::ScaledStrength(const Material& base) : base_(base), state_names_{"strength_surplus"} {
  for (const std::string& name : base.stateNames()) {
    state_names_.push_back(name);
    scaled_.push_back(!endsWith(name, "damage"));
  }
}

void ScaledStrength::update(MaterialBatch& batch) const {
  assert(batch.state.size() == state_names_.size());
  for (std::size_t begin = 0; begin < batch.count; begin += kTile) {
    updateTile(batch, begin, std::min(kTile, batch.count - begin));
  }
}

void ScaledStrength::updateTile(const MaterialBatch& batch, std::size_t begin, std::size_t count) const {
  const float* surplus = batch.state[0] + begin;
  float ratio[kTile], strain[kComponents][kTile];
  std::transform(surplus, surplus + count, ratio, strengthRatio);

  MaterialBatch scaled;
  scaled.count = count;
  for (std::size_t c = 0; c < kComponents; ++c) {
    float* stress = batch.stress[c] + begin;
    for (std::size_t i = 0; i < count; ++i) {
      stress[i] /= ratio[i];
      strain[c][i] = batch.strain_increment[c][begin + i] / ratio[i];
    }
    scaled.stress[c] = stress;
    scaled.strain_increment[c] = strain[c];
  }
  for (std::size_t k = 0; k < scaled_.size(); ++k) {
    float* values = batch.state[k + 1] + begin;
    if (scaled_[k]) {
      for (std::size_t i = 0; i < count; ++i) values[i] /= ratio[i];
    }
    scaled.state.push_back(values);
  }
  base_.update(scaled);
  for (std::size_t c = 0; c < kComponents; ++c) {
    for (std::size_t i = 0; i < count; ++i) scaled.stress[c][i] *= ratio[i];
  }
  for (std::size_t k = 0; k < scaled_.size(); ++k) {
    if (!scaled_[k]) continue;
    for (std::size_t i = 0; i < count; ++i) scaled.state[k][i] *= ratio[i];
  }
}

double ScaledStrength::elasticEnergyDensity(const std::array<float, kComponents>& stress_pa,
                                            const std::vector<float>& state) const {
  const float ratio = strengthRatio(state[0]);
  std::array<float, kComponents> stress = stress_pa;
  for (float& component : stress) component /= ratio;
  std::vector<float> of_base(state.begin() + 1, state.end());
  for (std::size_t k = 0; k < scaled_.size(); ++k) {
    if (scaled_[k]) of_base[k] /= ratio;
  }
  return static_cast<double>(ratio) * static_cast<double>(ratio) * base_.elasticEnergyDensity(stress, of_base);
}

}  // namespace brash_ice_rig
