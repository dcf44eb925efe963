#include "brash_ice_rig/node/rig_markers.h"

#include <cmath>
#include <iterator>
#include <limits>
#include <set>
#include <string>

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

/// A lift with the rig's 2 kN, ice of 8 kN in water, 5 kN of friction, 1 kN of drag, and 0.5 kN relief by inertia.
Snapshot makeSnapshot() {
  Snapshot snapshot;
  snapshot.stage = Stage::kLift;
  snapshot.time_s = 12.34;
  snapshot.force_n = 15000.0;  // the cell reads less than the truth
  snapshot.tension_n = 15500.0;
  snapshot.components.weight_n = 2400.0;
  snapshot.components.buoyancy_n = 400.0;
  snapshot.components.ice_normal_n = 13000.0;
  snapshot.components.ice_friction_n = 1000.0;
  snapshot.components.inertia_n = -500.0;
  snapshot.components.plug_gravity_n = 20000.0;
  snapshot.components.plug_buoyancy_n = 12000.0;
  snapshot.components.plug_drag_n = 1000.0;
  snapshot.components.plug_friction_n = 5000.0;
  return snapshot;
}

PlugOutline makePlug() {
  PlugOutline plug;
  plug.waterline = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.3}, {-1.0, 0.0, 0.0}, {0.0, -1.0, 0.0}};
  plug.top = {{0.5, 0.0, 1.25}, {0.0, 0.5, 1.25}, {-0.5, -0.5, 1.25}};
  plug.hole = {{2.0, 0.0, 0.1}, {0.0, 2.0, 0.1}, {-2.0, 0.0, 0.1}};
  return plug;
}

MarkerArray makeMarkers(const Snapshot& snapshot, const PlugOutline& plug) {
  Stamp stamp;
  stamp.time = ros::Time(20.0);
  stamp.frame_prefix = "east/";
  return toMarkers(stamp, Scenario(), snapshot, plug);
}

const Marker& find(const MarkerArray& array, const std::string& name, int id = 0) {
  for (const Marker& marker : array.markers) {
    if (marker.ns == name && marker.id == id) return marker;
  }
  ADD_FAILURE() << "no marker " << name << ' ' << id;
  return array.markers.front();
}

TEST(RigMarkers, PartsAddUpToTheTension) {
  double sum_n = 0.0;
  for (const ForcePart& part : splitTension(makeSnapshot())) sum_n += part.force_n;
  EXPECT_NEAR(sum_n, makeSnapshot().tension_n, 1e-9);
}

TEST(RigMarkers, ArrowShowsTheReadingDownwards) {
  const Marker arrow = find(makeMarkers(makeSnapshot(), {}), "force");
  EXPECT_EQ(arrow.header.frame_id, "east/load_cell");
  ASSERT_EQ(arrow.points.size(), 2u);
  EXPECT_EQ(arrow.points[0].z, 0.0);
  EXPECT_DOUBLE_EQ(arrow.points[1].z, -1.5);  // 1 m for 10 kN
}

TEST(RigMarkers, FrozenWorldHasAnArrowOfNoLength) {
  Snapshot snapshot = makeSnapshot();
  snapshot.force_n = std::numeric_limits<double>::quiet_NaN();
  snapshot.components.plug_drag_n = std::numeric_limits<double>::infinity();
  const MarkerArray array = makeMarkers(snapshot, {});
  EXPECT_EQ(find(array, "force").points[1].z, 0.0);
  for (const Marker& marker : array.markers) {
    EXPECT_TRUE(std::isfinite(marker.pose.position.z) && std::isfinite(marker.scale.z)) << marker.ns;
  }
}

TEST(RigMarkers, BarsHangInAStackAndLiftingPartsStandAbove) {
  const MarkerArray array = makeMarkers(makeSnapshot(), {});
  double hanging_to_m = 0.0, standing_to_m = 0.0;
  const auto parts = splitTension(makeSnapshot());
  for (int id = 0; id < static_cast<int>(parts.size()); ++id) {
    const Marker& bar = find(array, "components", 100 + id);
    const double length_m = kMarkerMetresPerNewton * std::abs(parts[static_cast<std::size_t>(id)].force_n);
    EXPECT_NEAR(bar.scale.z, length_m, 1e-12);
    if (parts[static_cast<std::size_t>(id)].force_n > 0.0) {
      EXPECT_NEAR(bar.pose.position.z + 0.5 * length_m, hanging_to_m, 1e-12) << "it begins where the last one ends";
      hanging_to_m -= length_m;
    } else {
      EXPECT_NEAR(bar.pose.position.z - 0.5 * length_m, standing_to_m, 1e-12);
      standing_to_m += length_m;
    }
  }
  EXPECT_NEAR(-hanging_to_m - standing_to_m, 1.55, 1e-12) << "down less up is the tension";
}

TEST(RigMarkers, EachBarHasALineOfItsColourAndValue) {
  const MarkerArray array = makeMarkers(makeSnapshot(), {});
  const Marker& ice = find(array, "components", 2);
  EXPECT_EQ(ice.color.b, find(array, "components", 101).color.b);
  EXPECT_NE(ice.text.find("ice in water 8.0 kN"), std::string::npos) << ice.text;
  EXPECT_NE(find(array, "components", 5).text.find("-0.5 kN"), std::string::npos);
}

TEST(RigMarkers, LinesOfTextDoNotOverlap) {
  const MarkerArray array = makeMarkers(makeSnapshot(), makePlug());
  std::set<double> left, right;
  double height = 0.0;
  for (const Marker& marker : array.markers) {
    if (marker.type != Marker::TEXT_VIEW_FACING || marker.ns == "text") continue;
    (marker.ns == "components" ? right : left).insert(marker.pose.position.z);
    height = marker.scale.z;
  }
  EXPECT_EQ(left.size(), 3u);
  EXPECT_EQ(right.size(), 5u);
  for (const auto& side : {left, right}) {
    for (auto line = side.begin(); std::next(line) != side.end(); ++line) EXPECT_GE(*std::next(line) - *line, height);
  }
}

TEST(RigMarkers, OutlinesAreClosedAndLieOnTheirCorners) {
  const MarkerArray array = makeMarkers(makeSnapshot(), makePlug());
  const Marker& waterline = find(array, "plug_waterline");
  EXPECT_EQ(waterline.header.frame_id, "east/map");
  ASSERT_EQ(waterline.points.size(), 5u);
  EXPECT_EQ(waterline.points.front().x, waterline.points.back().x);
  EXPECT_EQ(waterline.points.front().y, waterline.points.back().y);
  EXPECT_EQ(waterline.points[1].y, 1.0);
  // The line's lower edge lies on the corner.
  EXPECT_NEAR(waterline.points[1].z, 0.3 + 0.5 * waterline.scale.x, 1e-12);
  for (const auto& point : find(array, "plug_top").points) EXPECT_NEAR(point.z, 1.25, 0.1);
  EXPECT_EQ(find(array, "hole").points.size(), 4u);
}

TEST(RigMarkers, PlugThatIsGoneIsDeleted) {
  for (const char* name : {"plug_waterline", "plug_top", "hole"}) {
    EXPECT_EQ(find(makeMarkers(makeSnapshot(), makePlug()), name).action, Marker::ADD) << name;
    for (const int id : {0, name == std::string("plug_top") ? 1 : name == std::string("plug_waterline") ? 2 : 3}) {
      EXPECT_EQ(find(makeMarkers(makeSnapshot(), {}), name, id).action, Marker::DELETE) << name << ' ' << id;
    }
  }
}

}  // namespace
}  // namespace brash_ice_rig
