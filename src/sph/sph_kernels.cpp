// Compiled once per instruction set; see simd/lanes.h for what may stand here.

#include "brash_ice_rig/sph/sph_kernels.h"

#include "brash_ice_rig/simd/lanes.h"

namespace brash_ice_rig {
namespace {

constexpr std::size_t kPairs = PairBlock::kPairs;

/// A pair closer than this to the edge of the support has no measurable weight, and its viscosity factor overflows.
constexpr float kSupportMargin = 1.0e-4f;

BRASH_ICE_INLINE Float4 loadPadded(const Padded3& from) {
  return load<Float4>(from.component);
}

BRASH_ICE_INLINE Float8 splat8(float v) {
  return Float8{v, v, v, v, v, v, v, v};
}

/// Where the record of a pair's neighbour is.
template <class Record>
BRASH_ICE_INLINE const Record& neighbourOf(const Record* records, const PairBlock& block, std::size_t lane) {
  static_assert(sizeof(Record) == 16 || sizeof(Record) == 64, "an address counts 1, 2, 4 or 8 times an index");
  const std::size_t index = block.eightfold_neighbour[lane];
  return *reinterpret_cast<const Record*>(reinterpret_cast<const char*>(records) + sizeof(Record) / 8 * index);
}

/// x, y and z of eight velocities, lane by lane.
struct Components8 {
  Float8 x, y, z;
};

BRASH_ICE_INLINE Components8 gatherVelocities(const Padded3* velocity, const PairBlock& block) {
  const auto both = [&](std::size_t low, std::size_t high) {
    return join(loadPadded(neighbourOf(velocity, block, low)), loadPadded(neighbourOf(velocity, block, high)));
  };
  const Float8 a = both(0, 4), b = both(1, 5), c = both(2, 6), d = both(3, 7);
  const Float8 xy_ab = shuffle<0, 8, 1, 9, 4, 12, 5, 13>(a, b), xy_cd = shuffle<0, 8, 1, 9, 4, 12, 5, 13>(c, d);
  const Float8 z_ab = shuffle<2, 10, 3, 11, 6, 14, 7, 15>(a, b), z_cd = shuffle<2, 10, 3, 11, 6, 14, 7, 15>(c, d);
  return {shuffle<0, 1, 8, 9, 4, 5, 12, 13>(xy_ab, xy_cd), shuffle<2, 3, 10, 11, 6, 7, 14, 15>(xy_ab, xy_cd),
          shuffle<0, 1, 8, 9, 4, 5, 12, 13>(z_ab, z_cd)};
}

/// The sums over the lanes of four vectors.
BRASH_ICE_INLINE Float4 sumLanes(const Float8& a, const Float8& b, const Float8& c, const Float8& d) {
  const Float4 e = low(a) + high(a), f = low(b) + high(b), g = low(c) + high(c), h = low(d) + high(d);
  const Float4 ef = shuffle<0, 4, 1, 5>(e, f) + shuffle<2, 6, 3, 7>(e, f);
  const Float4 gh = shuffle<0, 4, 1, 5>(g, h) + shuffle<2, 6, 3, 7>(g, h);
  return shuffle<0, 1, 4, 5>(ef, gh) + shuffle<2, 3, 6, 7>(ef, gh);
}

struct Gathered {
  Float4 along_x, along_y, along_z;  ///< sum_j (v_j - v_i)_a V_j grad W_ij for a = x, y, z
  Float4 viscosity;                  ///< viscous force over V_i
};

BRASH_ICE_INLINE Gathered gatherRow(const SphRows& rows, std::size_t i) {
  const Padded3* const velocity = rows.velocity;
  const Float8 own_x = splat8(velocity[i].component[0]), own_y = splat8(velocity[i].component[1]),
               own_z = splat8(velocity[i].component[2]);
  Float8 xx{}, xy{}, xz{}, yx{}, yy{}, yz{}, zx{}, zy{}, zz{}, fx{}, fy{}, fz{};
  const PairBlock* block = rows.blocks + rows.block_begin[i];
  const PairBlock* const end = block + rows.block_count[i];
  for (; block != end; ++block) {
    const Components8 other = gatherVelocities(velocity, *block);
    const Float8 dx = other.x - own_x, dy = other.y - own_y, dz = other.z - own_z;
    const Float8 gx = load<Float8>(block->gx), gy = load<Float8>(block->gy), gz = load<Float8>(block->gz);
    const Float8 px = dx * gx, py = dy * gy, pz = dz * gz;
    xx += px;
    xy += dx * gy;
    xz += dx * gz;
    yx += dy * gx;
    yy += py;
    yz += dy * gz;
    zx += dz * gx;
    zy += dz * gy;
    zz += pz;
    const Float8 push = (px + py + pz) * load<Float8>(block->q);
    fx += push * gx;
    fy += push * gy;
    fz += push * gz;
  }
  const Float8 none{};
  return {sumLanes(xx, xy, xz, none), sumLanes(yx, yy, yz, none), sumLanes(zx, zy, zz, none),
          sumLanes(fx, fy, fz, none)};
}

/// Antisymmetric part of the velocity gradient, times the step.
struct Spin {
  float xy, yz, zx;
};

/// Turns a symmetric tensor with the spin w of one step: t + w t - t w, written out by component.
BRASH_ICE_INLINE void rotate(float* const* tensor, std::size_t i, const Spin& w) {
  const float xx = tensor[0][i], yy = tensor[1][i], zz = tensor[2][i];
  const float xy = tensor[3][i], yz = tensor[4][i], zx = tensor[5][i];
  tensor[0][i] = xx + 2.0f * (w.xy * xy - w.zx * zx);
  tensor[1][i] = yy + 2.0f * (w.yz * yz - w.xy * xy);
  tensor[2][i] = zz + 2.0f * (w.zx * zx - w.yz * yz);
  tensor[3][i] = xy + w.xy * (yy - xx) - w.zx * yz + w.yz * zx;
  tensor[4][i] = yz + w.yz * (zz - yy) - w.xy * zx + w.zx * xy;
  tensor[5][i] = zx + w.zx * (xx - zz) - w.yz * xy + w.xy * yz;
}

void strain(const SphRows& rows, std::size_t begin, std::size_t end, float time_step_s, float smallest_volume,
            float largest_volume) {
  const std::size_t count = end - begin;
  float raw[9][kSphTile];  // the gathered gradient, before its correction
  for (std::size_t k = 0; k < count; ++k) {
    const Gathered gathered = gatherRow(rows, begin + k);
    store(rows.viscosity[begin + k].component, gathered.viscosity);
    for (std::size_t c = 0; c < 3; ++c) {
      raw[c][k] = gathered.along_x[c];
      raw[3 + c][k] = gathered.along_y[c];
      raw[6 + c][k] = gathered.along_z[c];
    }
  }

  const float* b[9];
  float* e[6];
  for (std::size_t c = 0; c < 9; ++c) b[c] = rows.correction[c] + begin;
  for (std::size_t c = 0; c < 6; ++c) e[c] = rows.strain_increment[c] + begin;
  float* const volume = rows.volume + begin;
  float spin_xy[kSphTile], spin_yz[kSphTile], spin_zx[kSphTile];
#pragma GCC ivdep
  for (std::size_t k = 0; k < count; ++k) {
    const auto increment = [&](std::size_t row, std::size_t column) {
      return time_step_s * (raw[3 * row][k] * b[column][k] + raw[3 * row + 1][k] * b[3 + column][k] +
                            raw[3 * row + 2][k] * b[6 + column][k]);
    };
    const float xx = increment(0, 0), xy = increment(0, 1), xz = increment(0, 2);
    const float yx = increment(1, 0), yy = increment(1, 1), yz = increment(1, 2);
    const float zx = increment(2, 0), zy = increment(2, 1), zz = increment(2, 2);
    e[0][k] = xx;
    e[1][k] = yy;
    e[2][k] = zz;
    e[3][k] = 0.5f * (xy + yx);
    e[4][k] = 0.5f * (yz + zy);
    e[5][k] = 0.5f * (zx + xz);
    const float grown = volume[k] * (1.0f + (xx + yy + zz));
    const float not_small = grown < smallest_volume ? smallest_volume : grown;
    volume[k] = not_small > largest_volume ? largest_volume : not_small;
    spin_xy[k] = 0.5f * (xy - yx);
    spin_yz[k] = 0.5f * (yz - zy);
    spin_zx[k] = 0.5f * (zx - xz);
  }

  // Jaumann rate: what was there turns with the particle.
  for (std::size_t tensor = 0; tensor <= rows.tensor_count; ++tensor) {
    float* const* source = tensor == 0 ? rows.stress : rows.tensors + 6 * (tensor - 1);
    float* const arrays[6] = {source[0] + begin, source[1] + begin, source[2] + begin,
                              source[3] + begin, source[4] + begin, source[5] + begin};
#pragma GCC ivdep
    for (std::size_t k = 0; k < count; ++k) rotate(arrays, k, {spin_xy[k], spin_yz[k], spin_zx[k]});
  }
}

void correctStress(const SphRows& rows, std::size_t begin, std::size_t end) {
  const std::size_t count = end - begin;
  const float* s[6];
  const float* b[9];
  for (std::size_t c = 0; c < 6; ++c) s[c] = rows.stress[c] + begin;
  for (std::size_t c = 0; c < 9; ++c) b[c] = rows.correction[c] + begin;
  float product[9][kSphTile];  // by columns
#pragma GCC ivdep
  for (std::size_t k = 0; k < count; ++k) {
    const float xx = s[0][k], yy = s[1][k], zz = s[2][k], xy = s[3][k], yz = s[4][k], zx = s[5][k];
    for (std::size_t column = 0; column < 3; ++column) {
      const float b0 = b[column][k], b1 = b[3 + column][k], b2 = b[6 + column][k];
      product[3 * column][k] = xx * b0 + xy * b1 + zx * b2;
      product[3 * column + 1][k] = xy * b0 + yy * b1 + yz * b2;
      product[3 * column + 2][k] = zx * b0 + yz * b1 + zz * b2;
    }
  }
  for (std::size_t k = 0; k < count; ++k) {
    CorrectedStress& out = rows.corrected_stress[begin + k];
    for (std::size_t column = 0; column < 3; ++column) {
      store(out.column[column],
            Float4{product[3 * column][k], product[3 * column + 1][k], product[3 * column + 2][k], 0.0f});
    }
  }
}

/// One of four neighbours: two columns of its stress times the gradient's x and y, the third times z.
/// @param gxy  x of the four, y of the four
template <int kLane>
BRASH_ICE_INLINE void addNeighbour(const CorrectedStress& other, const Float8& gxy, const Float4& gz, Float8& first,
                                   Float4& last) {
  constexpr int n = kLane, m = kLane + 4;
  first += load<Float8>(other.column[0]) * shuffle<n, n, n, n, m, m, m, m>(gxy, gxy);
  last += load<Float4>(other.column[2]) * shuffle<n, n, n, n>(gz, gz);
}

template <std::size_t kFirst>
BRASH_ICE_INLINE void addNeighbours(const CorrectedStress* stress, const PairBlock& block, const Float8& gxy,
                                    const Float4& gz, Float8& first_even, Float8& first_odd, Float4& last_even,
                                    Float4& last_odd) {
  addNeighbour<0>(neighbourOf(stress, block, kFirst), gxy, gz, first_even, last_even);
  addNeighbour<1>(neighbourOf(stress, block, kFirst + 1), gxy, gz, first_odd, last_odd);
  addNeighbour<2>(neighbourOf(stress, block, kFirst + 2), gxy, gz, first_even, last_even);
  addNeighbour<3>(neighbourOf(stress, block, kFirst + 3), gxy, gz, first_odd, last_odd);
}

void force(const SphRows& rows, std::size_t begin, std::size_t end) {
  const CorrectedStress* const stress = rows.corrected_stress;
  for (std::size_t i = begin; i < end; ++i) {
    // Neighbours of even and odd lane apart: one sum alone would wait for itself.
    Float8 first_even{}, first_odd{};
    Float4 last_even{}, last_odd{};
    const PairBlock* block = rows.blocks + rows.block_begin[i];
    const PairBlock* const row_end = block + rows.block_count[i];
    for (; block != row_end; ++block) {
      const Float8 gx = load<Float8>(block->gx), gy = load<Float8>(block->gy), gz = load<Float8>(block->gz);
      addNeighbours<0>(stress, *block, shuffle<0, 1, 2, 3, 8, 9, 10, 11>(gx, gy), low(gz), first_even, first_odd,
                       last_even, last_odd);
      addNeighbours<4>(stress, *block, shuffle<4, 5, 6, 7, 12, 13, 14, 15>(gx, gy), high(gz), first_even, first_odd,
                       last_even, last_odd);
    }
    const Float8 first = first_even + first_odd;
    const CorrectedStress& own = stress[i];
    const float* const sum = rows.gradient_sum[i].component;
    const Float4 own_part = load<Float4>(own.column[0]) * sum[0] + load<Float4>(own.column[1]) * sum[1] +
                            load<Float4>(own.column[2]) * sum[2];
    const Float4 total = loadPadded(rows.viscosity[i]) + own_part + (low(first) + high(first) + (last_even + last_odd));
    store(rows.force[i].component, rows.cached_volume[i] * total);
  }
}

void velocityGradient(const SphRows& rows, std::size_t i, float* gradient) {
  const Gathered gathered = gatherRow(rows, i);
  const Float4 raw[3] = {gathered.along_x, gathered.along_y, gathered.along_z};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      gradient[3 * row + column] = raw[row][0] * rows.correction[column][i] +
                                   raw[row][1] * rows.correction[3 + column][i] +
                                   raw[row][2] * rows.correction[6 + column][i];
    }
  }
}

std::int32_t refresh(std::size_t i, const double (*position)[3], const double* smoothing, const float* volume,
                     float viscosity, const std::int32_t* candidates, std::size_t count, PairBlock* row, Padded3* sum,
                     double* moment) {
  constexpr float kPi = 3.14159265358979323846f;
  Float8 sum_x{}, sum_y{}, sum_z{}, xx{}, yy{}, zz{}, xy{}, yz{}, zx{};
  std::size_t filled = 0;
  for (std::size_t first = 0; first < count; first += kPairs) {
    // The difference is taken in double: far from the origin a float would not see small moves.
    float x[kPairs], y[kPairs], z[kPairs], h[kPairs], v[kPairs];
    std::int32_t j[kPairs];
    for (std::size_t n = 0; n < kPairs; ++n) {
      j[n] = first + n < count ? candidates[first + n] : static_cast<std::int32_t>(i);
      x[n] = static_cast<float>(position[i][0] - position[j[n]][0]);
      y[n] = static_cast<float>(position[i][1] - position[j[n]][1]);
      z[n] = static_cast<float>(position[i][2] - position[j[n]][2]);
      h[n] = static_cast<float>(0.5 * (smoothing[i] + smoothing[j[n]]));  // of equal ones: exactly that one
      v[n] = volume[j[n]];
    }
    float gx[kPairs], gy[kPairs], gz[kPairs], q[kPairs];
    std::int32_t within[kPairs];
#pragma GCC ivdep
    for (std::size_t n = 0; n < kPairs; ++n) {
      const float distance_squared = x[n] * x[n] + y[n] * y[n] + z[n] * z[n];
      const float distance = __builtin_sqrtf(distance_squared);
      const float ratio = distance / h[n];
      const bool in_reach = (ratio < 2.0f - kSupportMargin) & (distance_squared > 0.0f);
      within[n] = in_reach ? 1 : 0;
      const float tail = 2.0f - ratio;
      // dW/dr of the cubic spline, sph/kernel.h.
      const float shape = ratio < 1.0f ? ratio * (2.25f * ratio - 3.0f) : -0.75f * tail * tail;
      const float h_squared = h[n] * h[n];
      const float slope = v[n] * shape / (kPi * h_squared * h_squared);
      const float along = slope / (in_reach ? distance : 1.0f);
      gx[n] = in_reach ? along * x[n] : 0.0f;
      gy[n] = in_reach ? along * y[n] : 0.0f;
      gz[n] = in_reach ? along * z[n] : 0.0f;
      const float softened = distance_squared + 0.01f * h_squared;
      q[n] = in_reach ? viscosity * h[n] * distance / (softened * -slope) : 0.0f;
    }
    const Float8 vx = load<Float8>(x), vy = load<Float8>(y), vz = load<Float8>(z);
    const Float8 wx = load<Float8>(gx), wy = load<Float8>(gy), wz = load<Float8>(gz);
    sum_x += wx;
    sum_y += wy;
    sum_z += wz;
    xx -= vx * wx;
    yy -= vy * wy;
    zz -= vz * wz;
    xy -= vx * wy;
    yz -= vy * wz;
    zx -= vz * wx;
    // Each is written; the next one takes its place where it is out of reach.
    for (std::size_t n = 0; n < kPairs; ++n) {
      PairBlock& block = row[filled / kPairs];
      const std::size_t lane = filled % kPairs;
      block.gx[lane] = gx[n];
      block.gy[lane] = gy[n];
      block.gz[lane] = gz[n];
      block.q[lane] = q[n];
      block.eightfold_neighbour[lane] = 8u * static_cast<std::uint32_t>(j[n]);
      filled += static_cast<std::size_t>(within[n]);
    }
  }
  const std::size_t blocks = (filled + kPairs - 1) / kPairs;
  for (std::size_t n = filled; n < blocks * kPairs; ++n) {
    PairBlock& block = row[n / kPairs];
    const std::size_t lane = n % kPairs;
    block.gx[lane] = block.gy[lane] = block.gz[lane] = block.q[lane] = 0.0f;
    block.eightfold_neighbour[lane] = 8u * static_cast<std::uint32_t>(i);
  }
  store(sum->component, sumLanes(sum_x, sum_y, sum_z, Float8{}));
  const auto total = [](const Float8& lanes) {
    double result = 0.0;
    for (std::size_t n = 0; n < kPairs; ++n) result += static_cast<double>(lanes[n]);
    return result;
  };
  moment[0] = total(xx);
  moment[1] = total(yy);
  moment[2] = total(zz);
  moment[3] = total(xy);
  moment[4] = total(yz);
  moment[5] = total(zx);
  return static_cast<std::int32_t>(blocks);
}

}  // namespace

extern const SphKernels BRASH_ICE_NAME_OF_SET(kSphKernels_);
const SphKernels BRASH_ICE_NAME_OF_SET(kSphKernels_) = {strain, correctStress, force, velocityGradient, refresh};

}  // namespace brash_ice_rig
