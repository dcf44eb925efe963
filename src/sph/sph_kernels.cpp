// Compiled once per instruction set; see simd/lanes.h for what may stand here.

#include "brash_ice_rig/sph/sph_kernels.h"

#include "brash_ice_rig/simd/lanes.h"

namespace brash_ice_rig {
namespace {

constexpr std::size_t kPairs = PairBlock::kPairs;

/// A pair closer than this to the edge of the support has no measurable weight, and its viscosity factor overflows.
constexpr float kSupportMargin = 1.0e-4f;

/// The arrays of the loop that follows do not overlap. Clang looks at that itself, when the program runs.
#ifdef __clang__
#define BRASH_ICE_INDEPENDENT_ITERATIONS
#else
#define BRASH_ICE_INDEPENDENT_ITERATIONS _Pragma("GCC ivdep")
#endif

using Int8 __attribute__((vector_size(32))) = std::int32_t;

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

/// The four components of eight records, lane by lane.
struct Components8 {
  Float8 x, y, z, w;
};

/// @param record  gives the n-th of the eight
template <class Record>
BRASH_ICE_INLINE Components8 gatherComponents(const Record& record) {
  const Float8 a = join(record(0), record(4)), b = join(record(1), record(5));
  const Float8 c = join(record(2), record(6)), d = join(record(3), record(7));
  const Float8 xy_ab = shuffle<0, 8, 1, 9, 4, 12, 5, 13>(a, b), xy_cd = shuffle<0, 8, 1, 9, 4, 12, 5, 13>(c, d);
  const Float8 zw_ab = shuffle<2, 10, 3, 11, 6, 14, 7, 15>(a, b), zw_cd = shuffle<2, 10, 3, 11, 6, 14, 7, 15>(c, d);
  return {shuffle<0, 1, 8, 9, 4, 5, 12, 13>(xy_ab, xy_cd), shuffle<2, 3, 10, 11, 6, 7, 14, 15>(xy_ab, xy_cd),
          shuffle<0, 1, 8, 9, 4, 5, 12, 13>(zw_ab, zw_cd), shuffle<2, 3, 10, 11, 6, 7, 14, 15>(zw_ab, zw_cd)};
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
               own_z = splat8(velocity[i].component[2]), own_cut = splat8(velocity[i].component[3]);
  Float8 xx{}, xy{}, xz{}, yx{}, yy{}, yz{}, zx{}, zy{}, zz{}, fx{}, fy{}, fz{};
  const PairBlock* block = rows.blocks + rows.block_begin[i];
  const PairBlock* const end = block + rows.block_count[i];
  for (; block != end; ++block) {
    const Components8 other =
        gatherComponents([&](std::size_t n) { return loadPadded(neighbourOf(velocity, *block, n)); });
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
    const Float8 cut = other.w > own_cut ? other.w : own_cut;
    const Float8 push = (px + py + pz) * (load<Float8>(block->q) * (1.0f - cut));
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
  BRASH_ICE_INDEPENDENT_ITERATIONS
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
    BRASH_ICE_INDEPENDENT_ITERATIONS
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
  BRASH_ICE_INDEPENDENT_ITERATIONS
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

BRASH_ICE_INLINE Float8 select(const Int8& mask, const Float8& yes, const Float8& no) {
  return (Float8)(((Int8)yes & mask) | ((Int8)no & ~mask));
}

/// From the neighbours to a particle, with what decides whether they are within reach.
struct Offset8 {
  Float8 x, y, z, h;  ///< m; h is the mean of both
  Float8 distance_squared, distance, ratio;
  Int8 in_reach;
};

BRASH_ICE_INLINE Offset8 computeOffsets(const SphSites& sites, std::size_t i, const std::int32_t* neighbour) {
  const SphSite& own = sites.site[i];
  const Components8 other = gatherComponents(
      [&](std::size_t n) { return load<Float4>(&sites.site[static_cast<std::size_t>(neighbour[n])]); });
  // Of whole numbers, so that the difference is exact however far from the origin both are.
  const auto difference = [&](std::int32_t from, const Float8& to) {
    return __builtin_convertvector(from - (Int8)to, Float8) * sites.unit_m;
  };
  Offset8 result;
  result.x = difference(own.x, other.x);
  result.y = difference(own.y, other.y);
  result.z = difference(own.z, other.z);
  result.h = 0.5f * (own.smoothing_length_m + other.w);  // of equal ones: exactly that one
  result.distance_squared = result.x * result.x + result.y * result.y + result.z * result.z;
  for (std::size_t n = 0; n < kPairs; ++n) result.distance[n] = __builtin_sqrtf(result.distance_squared[n]);
  result.ratio = result.distance / result.h;
  result.in_reach = (result.ratio < 2.0f - kSupportMargin) & (result.distance_squared > 0.0f);
  return result;
}

/// Those of the candidates that are within reach, filled up to whole blocks with the particle itself.
/// @return how many are within reach
std::size_t findNeighbours(const SphSites& sites, std::size_t i, const std::int32_t* candidates, std::size_t count,
                           std::int32_t* neighbour) {
  const auto own = static_cast<std::int32_t>(i);
  std::size_t found = 0;
  const auto take = [&](const std::int32_t* eight) {
    const Int8 in_reach = computeOffsets(sites, i, eight).in_reach;
    for (std::size_t n = 0; n < kPairs; ++n) {
      neighbour[found] = eight[n];  // the next one takes its place where it is out of reach
      found += static_cast<std::size_t>(in_reach[n] & 1);
    }
  };
  const std::size_t whole = count / kPairs * kPairs;
  for (std::size_t first = 0; first < whole; first += kPairs) take(candidates + first);
  if (whole < count) {
    std::int32_t last[kPairs];
    for (std::size_t n = 0; n < kPairs; ++n) last[n] = whole + n < count ? candidates[whole + n] : own;
    take(last);
  }
  for (std::size_t n = 0; n < kPairs; ++n) neighbour[found + n] = own;
  return found;
}

BRASH_ICE_INLINE double total(const Float8& lanes) {
  double result = 0.0;
  for (std::size_t n = 0; n < kPairs; ++n) result += static_cast<double>(lanes[n]);
  return result;
}

std::int32_t refresh(const SphSites& sites, std::size_t i, const std::int32_t* candidates, std::size_t count,
                     std::int32_t* neighbour, PairBlock* row, std::size_t room, Padded3* sum, double* moment,
                     double* viscosity) {
  constexpr float kInversePi = 0.318309886183790672f;
  const std::size_t found = findNeighbours(sites, i, candidates, count, neighbour);
  const std::size_t blocks = (found + kPairs - 1) / kPairs;
  if (blocks > room) return static_cast<std::int32_t>(blocks);
  Float8 sum_x{}, sum_y{}, sum_z{}, xx{}, yy{}, zz{}, xy{}, yz{}, zx{}, braking{};
  for (std::size_t b = 0; b < blocks; ++b) {
    const std::int32_t* const eight = neighbour + b * kPairs;
    const Offset8 to = computeOffsets(sites, i, eight);
    Float8 volume;
    for (std::size_t n = 0; n < kPairs; ++n) volume[n] = sites.volume[static_cast<std::size_t>(eight[n])];
    // dW/dr of the cubic spline, sph/kernel.h.
    const Float8 tail = 2.0f - to.ratio;
    const Float8 shape = select(to.ratio < 1.0f, to.ratio * (2.25f * to.ratio - 3.0f), -0.75f * tail * tail);
    const Float8 h_squared = to.h * to.h;
    const Float8 slope = volume * shape * kInversePi / (h_squared * h_squared);
    // The particle itself, which fills up the last block, has neither.
    const Float8 none{};
    const Float8 along = select(to.in_reach, slope / to.distance, none);
    const Float8 softened = to.distance_squared + 0.01f * h_squared;
    const Float8 q = select(to.in_reach, sites.viscosity * to.h * to.distance / (softened * -slope), none);
    const Float8 gx = along * to.x, gy = along * to.y, gz = along * to.z;
    sum_x += gx;
    sum_y += gy;
    sum_z += gz;
    xx -= to.x * gx;
    yy -= to.y * gy;
    zz -= to.z * gz;
    xy -= to.x * gy;
    yz -= to.y * gz;
    zx -= to.z * gx;
    braking += q * (gx * gx + gy * gy + gz * gz);
    store(row[b].gx, gx);
    store(row[b].gy, gy);
    store(row[b].gz, gz);
    store(row[b].q, q);
    for (std::size_t n = 0; n < kPairs; ++n) {
      row[b].eightfold_neighbour[n] = 8u * static_cast<std::uint32_t>(eight[n]);
    }
  }
  store(sum->component, sumLanes(sum_x, sum_y, sum_z, Float8{}));
  moment[0] = total(xx);
  moment[1] = total(yy);
  moment[2] = total(zz);
  moment[3] = total(xy);
  moment[4] = total(yz);
  moment[5] = total(zx);
  *viscosity = total(braking);
  return static_cast<std::int32_t>(blocks);
}

}  // namespace

extern const SphKernels BRASH_ICE_NAME_OF_SET(kSphKernels_);
const SphKernels BRASH_ICE_NAME_OF_SET(kSphKernels_) = {strain, correctStress, force, velocityGradient, refresh};

}  // namespace brash_ice_rig
