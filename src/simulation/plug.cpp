#include "brash_ice_rig/simulation/plug.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "brash_ice_rig/math/angle.h"
#include "brash_ice_rig/math/repeatable.h"

namespace brash_ice_rig {
namespace {

/// Radius of a disc as large as the sections of `count` particles, m.
double discRadius(std::size_t count, double spacing_m) {
  return spacing_m * std::sqrt(static_cast<double>(count) / kPi);
}

/// Thickness of what counts as the top layer, in spacings.
constexpr double kTopLayer = 0.8;

/// How far over the lowest site the bottom layer reaches, in spacings: with the largest jitter 0.6.
constexpr double kBottomLayer = 0.65;

/// Rise from which the surface counts as bulged, in spacings.
constexpr double kBulged = 0.1;

bool isAtWaterline(double z_m, double spacing_m) {
  return std::abs(z_m) <= 0.5 * spacing_m;
}

bool isAtTop(double z_m, double top_m, double spacing_m) {
  return z_m > top_m - spacing_m;
}

bool isBottomSite(double z_m, double bottom_m, double spacing_m) {
  return z_m <= bottom_m + kBottomLayer * spacing_m;
}

double lowest(const std::vector<Eigen::Vector3d>& points_m) {
  double bottom = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& point : points_m) bottom = std::min(bottom, point.z());
  return bottom;
}

double crossProduct(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Andrew's monotone chain (Information Processing Letters 9, 1979, p. 216). Counter-clockwise, no point twice.
std::vector<Eigen::Vector2d> convexHull(std::vector<Eigen::Vector2d> points) {
  const auto before = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  };
  std::sort(points.begin(), points.end(), before);
  std::vector<Eigen::Vector2d> hull;
  // First the lower side from left to right, then the upper side back; both end with the point where the other begins.
  for (int side = 0; side < 2; ++side) {
    const std::size_t first = hull.size();
    for (const Eigen::Vector2d& point : points) {
      while (hull.size() >= first + 2 &&
             crossProduct(hull.back() - hull[hull.size() - 2], point - hull.back()) <= 0.0) {
        hull.pop_back();
      }
      hull.push_back(point);
    }
    if (!hull.empty()) hull.pop_back();
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

/// Lifts a polygon onto the highest particle near it, if that lies over z = 0.
void layOnto(const std::vector<Eigen::Vector3d>& particles_m, double spacing_m,
             std::vector<Eigen::Vector3d>& polygon_m) {
  const double reach = 0.75 * spacing_m;  // some column of a lattice lies within 0.71 spacings
  double height = 0.0;
  for (const Eigen::Vector3d& particle : particles_m) {
    const double top = particle.z() + 0.5 * spacing_m;
    if (top <= height) continue;
    const auto is_near = [&](const Eigen::Vector3d& corner) {
      return (particle - corner).head<2>().squaredNorm() <= reach * reach;
    };
    if (std::any_of(polygon_m.begin(), polygon_m.end(), is_near)) height = top;
  }
  for (Eigen::Vector3d& corner : polygon_m) corner.z() = height;
}

/// The polygon with corners in between, so that none is farther than a spacing from the next; z is 0.
std::vector<Eigen::Vector3d> subdivide(const std::vector<Eigen::Vector2d>& polygon_m, double spacing_m) {
  std::vector<Eigen::Vector3d> corners;
  for (std::size_t i = 0; i < polygon_m.size(); ++i) {
    const Eigen::Vector2d& from = polygon_m[i];
    const Eigen::Vector2d side = polygon_m[(i + 1) % polygon_m.size()] - from;
    const double parts = std::max(1.0, std::ceil(side.norm() / spacing_m));
    for (int part = 0; part < static_cast<int>(parts); ++part) {
      const Eigen::Vector2d corner = from + static_cast<double>(part) / parts * side;
      corners.emplace_back(corner.x(), corner.y(), 0.0);
    }
  }
  return corners;
}

/// Hull of the discs of half a spacing around the centres; z is 0.
std::vector<Eigen::Vector3d> outlineOf(const std::vector<Eigen::Vector2d>& centres_m, double spacing_m) {
  constexpr int kCorners = 12;
  std::vector<Eigen::Vector2d> points;
  points.reserve(centres_m.size() * kCorners);
  for (const Eigen::Vector2d& centre : centres_m) {
    for (int corner = 0; corner < kCorners; ++corner) {
      const double angle = 2.0 * kPi * corner / kCorners;
      points.emplace_back(centre + 0.5 * spacing_m * Eigen::Vector2d(repeatable::cos(angle), repeatable::sin(angle)));
    }
  }
  return subdivide(convexHull(std::move(points)), spacing_m);
}

void measureBulge(const std::vector<Eigen::Vector3d>& site_m, const std::vector<Eigen::Vector3d>& position_m,
                  double spacing_m, PlugSummary& plug) {
  double top = -std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& site : site_m) top = std::max(top, site.z());
  for (std::size_t i = 0; i < site_m.size(); ++i) {
    if (site_m[i].z() <= top - kTopLayer * spacing_m) continue;
    const double rise = position_m[i].z() - site_m[i].z();
    plug.bulge_height_m = std::max(plug.bulge_height_m, rise);
    if (rise > kBulged * spacing_m) plug.bulge_radius_m = std::max(plug.bulge_radius_m, site_m[i].head<2>().norm());
  }
}

}  // namespace

PlugSummary computePlug(const std::vector<Eigen::Vector3d>& site_m, const std::vector<Eigen::Vector3d>& position_m,
                        double spacing_m, double particle_mass_kg, double hub_height_m) {
  PlugSummary plug;
  measureBulge(site_m, position_m, spacing_m, plug);
  std::vector<std::size_t> raised;
  for (std::size_t i = 0; i < position_m.size(); ++i) {
    if (isRaised(site_m[i], position_m[i], spacing_m, hub_height_m)) raised.push_back(i);
  }
  plug.raised_particles = raised.size();
  plug.hole_sites = raised.size();
  plug.lifted_mass_kg = static_cast<double>(raised.size()) * particle_mass_kg;
  if (raised.empty()) return plug;

  double top = position_m[raised.front()].z();
  Eigen::Vector3d low = site_m[raised.front()], high = low;
  for (const std::size_t i : raised) {
    top = std::max(top, position_m[i].z());
    low = low.cwiseMin(site_m[i]);
    high = high.cwiseMax(site_m[i]);
  }
  std::size_t at_waterline = 0, at_top = 0;
  for (const std::size_t i : raised) {
    if (isAtWaterline(position_m[i].z(), spacing_m)) ++at_waterline;
    if (isAtTop(position_m[i].z(), top, spacing_m)) ++at_top;
  }
  plug.radius_at_waterline_m = discRadius(at_waterline, spacing_m);
  plug.radius_at_top_m = discRadius(at_top, spacing_m);

  const double reach = 0.5 * spacing_m;
  const double bottom = lowest(site_m);
  std::vector<Eigen::Vector3d> fillers, around;
  for (std::size_t i = 0; i < position_m.size(); ++i) {
    const Eigen::Vector3d& p = position_m[i];
    const auto outside = ((p - low).array() <= -reach) || ((high - p).array() <= -reach);
    if (outside.head<2>().any() || isRaised(site_m[i], p, spacing_m, hub_height_m)) continue;
    around.push_back(p);
    if (!outside.z()) fillers.push_back(p);
  }
  std::size_t refilled = 0, columns = 0, covered = 0;
  for (const std::size_t i : raised) {
    const auto fills = [&](const Eigen::Vector3d& p) { return (p - site_m[i]).squaredNorm() < reach * reach; };
    if (std::any_of(fillers.begin(), fillers.end(), fills)) ++refilled;
    if (!isBottomSite(site_m[i].z(), bottom, spacing_m)) continue;
    ++columns;
    const auto covers = [&](const Eigen::Vector3d& p) {
      return (p - site_m[i]).head<2>().squaredNorm() < reach * reach;
    };
    if (std::any_of(around.begin(), around.end(), covers)) ++covered;
  }
  if (columns > 0) plug.hole_cover_ratio = static_cast<double>(covered) / static_cast<double>(columns);
  plug.hole_refill_ratio = static_cast<double>(refilled) / static_cast<double>(plug.hole_sites);
  return plug;
}

PlugOutline computePlugOutline(const std::vector<Eigen::Vector3d>& site_m,
                               const std::vector<Eigen::Vector3d>& position_m, double spacing_m, double hub_height_m) {
  PlugOutline outline;
  std::vector<std::size_t> raised;
  std::vector<Eigen::Vector3d> left_behind;
  double top = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < position_m.size(); ++i) {
    if (isRaised(site_m[i], position_m[i], spacing_m, hub_height_m)) {
      raised.push_back(i);
      top = std::max(top, position_m[i].z());
    } else {
      left_behind.push_back(position_m[i]);
    }
  }
  if (raised.empty()) return outline;

  const double bottom = lowest(site_m);
  std::vector<Eigen::Vector2d> at_waterline, at_top, in_hole;
  for (const std::size_t i : raised) {
    const Eigen::Vector3d& position = position_m[i];
    if (isAtWaterline(position.z(), spacing_m)) at_waterline.emplace_back(position.head<2>());
    if (isAtTop(position.z(), top, spacing_m)) at_top.emplace_back(position.head<2>());
    if (isBottomSite(site_m[i].z(), bottom, spacing_m)) in_hole.emplace_back(site_m[i].head<2>());
  }
  outline.waterline = outlineOf(at_waterline, spacing_m);
  outline.top = outlineOf(at_top, spacing_m);
  outline.hole = outlineOf(in_hole, spacing_m);
  for (Eigen::Vector3d& corner : outline.top) corner.z() = top;
  for (auto* polygon : {&outline.waterline, &outline.hole}) layOnto(left_behind, spacing_m, *polygon);
  return outline;
}

}  // namespace brash_ice_rig
