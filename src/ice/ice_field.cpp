#include "brash_ice_rig/ice/ice_field.h"

#include <cmath>
#include <random>

namespace brash_ice_rig {
namespace {

/// Uniform in [-1, 1). Written out because the standard leaves its distributions to the library.
double symmetricUnit(std::mt19937_64& generator) {
  return static_cast<double>(generator() >> 11) * std::ldexp(1.0, -52) - 1.0;
}

std::size_t sites(double length_m, double spacing_m) {
  return static_cast<std::size_t>(std::lround(length_m / spacing_m));
}

}  // namespace

IceField makeIceField(const FieldConfig& config, double draft_m) {
  IceField field;
  const double dx = config.spacing_m;
  field.count_x = sites(config.length_x_m, dx);
  field.count_y = sites(config.length_y_m, dx);
  field.count_z = sites(config.thickness_m, dx);
  field.position_m.reserve(field.count_x * field.count_y * field.count_z);

  const Eigen::Vector3d corner(-0.5 * static_cast<double>(field.count_x) * dx,
                               -0.5 * static_cast<double>(field.count_y) * dx, -draft_m);
  std::mt19937_64 generator(config.seed);
  for (std::size_t ix = 0; ix < field.count_x; ++ix) {
    for (std::size_t iy = 0; iy < field.count_y; ++iy) {
      const bool edge = ix == 0 || iy == 0 || ix + 1 == field.count_x || iy + 1 == field.count_y;
      for (std::size_t iz = 0; iz < field.count_z; ++iz) {
        Eigen::Vector3d site(static_cast<double>(ix), static_cast<double>(iy), static_cast<double>(iz));
        site.array() += 0.5;
        if (config.jitter_ratio > 0.0) {
          for (int axis = 0; axis < 3; ++axis) site[axis] += config.jitter_ratio * symmetricUnit(generator);
        }
        field.position_m.push_back(corner + dx * site);
        field.fixed.push_back(edge);
      }
    }
  }
  return field;
}

}  // namespace brash_ice_rig
