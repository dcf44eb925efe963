#include "brash_ice_rig/node/rig_markers.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "brash_ice_rig/node/topic_names.h"
#include "brash_ice_rig/rig/collector.h"

namespace brash_ice_rig {
namespace {

using visualization_msgs::Marker;

constexpr double kLineHeightM = 0.42;  // of text; readable with the view of config/rviz/pull_up.rviz
constexpr double kBarOffsetM = 0.4;    // of the bars from the pole
constexpr double kOutlineWidthM = 0.07;

std_msgs::ColorRGBA makeColor(float r, float g, float b, float a) {
  std_msgs::ColorRGBA color;
  color.r = r;
  color.g = g;
  color.b = b;
  color.a = a;
  return color;
}

Marker makeMarker(const std_msgs::Header& header, const char* name, int type, const std_msgs::ColorRGBA& color) {
  Marker marker;
  marker.header = header;
  marker.ns = name;
  marker.type = type;
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.scale.x = marker.scale.y = marker.scale.z = 1.0;
  marker.color = color;
  return marker;
}

/// Eight triangles between the hub and neighbouring arm tips, in the frame of the hub.
Marker makeNet(const std_msgs::Header& header, const CollectorConfig& collector, const RigState& rig) {
  auto net = makeMarker(header, "net", Marker::TRIANGLE_LIST, makeColor(1.0F, 0.45F, 0.1F, 0.55F));
  const auto tip = [&](int arm) { return toPoint(armTipOffset(collector, rig.arm_angle_rad, arm)); };
  for (int arm = 0; arm < kArmCount; ++arm) {
    net.points.push_back(toPoint(Eigen::Vector3d::Zero()));
    net.points.push_back(tip(arm));
    net.points.push_back(tip(arm + 1));
  }
  return net;
}

double lengthOf(double force_n, double metres_per_newton) {
  return std::isfinite(force_n) ? metres_per_newton * force_n : 0.0;
}

/// Down from the load cell: the pull of the rig on the crane.
Marker makeForceArrow(const std_msgs::Header& header, double length_m) {
  Marker arrow = makeMarker(header, "force", Marker::ARROW, makeColor(0.9F, 0.1F, 0.1F, 1.0F));
  arrow.scale.x = 0.12;
  arrow.scale.y = 0.3;
  arrow.scale.z = 0.35;
  arrow.points.push_back(toPoint(Eigen::Vector3d::Zero()));
  arrow.points.push_back(toPoint({0.0, 0.0, -length_m}));
  return arrow;
}

/// Where a line of text begins, in blanks to the right of the pole (a blank is half as wide as a line is high).
constexpr int kRightOfPole = 3, kLeftOfPole = -14;
/// Rows above the load cell: with the collector at its lowest, five lines still stand clear of the ice.
constexpr int kRowsAbove = 1;

/// A line of text beside the pole, as seen from any side. rviz centres the longest line of a text at the marker, and
/// lets the others begin where that one begins: the longest is a line of blanks here.
Marker makeLine(const std_msgs::Header& load_cell, const char* name, int row, int begin, const std::string& text,
                const std_msgs::ColorRGBA& color) {
  constexpr int kHalf = 20;
  const auto blanks = [](int count) { return std::string(static_cast<std::size_t>(count), ' '); };
  Marker line = makeMarker(load_cell, name, Marker::TEXT_VIEW_FACING, color);
  line.id = 1 + row;
  line.scale.z = kLineHeightM;
  line.pose.position.z = 1.1 * kLineHeightM * (kRowsAbove - row);
  line.text = blanks(2 * kHalf) + "\n" + blanks(kHalf + begin) + text;
  return line;
}

/// One bar on the other beside the pole: those that pull down hang below the load cell, those that lift stand above.
/// To the right of them a line of text each.
void appendComponents(const std_msgs::Header& header, const Snapshot& snapshot, double metres_per_newton,
                      std::vector<Marker>& markers) {
  double hanging_m = 0.0, standing_m = 0.0;
  int id = 0;
  for (const ForcePart& part : splitTension(snapshot)) {
    const auto color = makeColor(part.color_rgb[0], part.color_rgb[1], part.color_rgb[2], 1.0F);
    const double length_m = lengthOf(part.force_n, metres_per_newton);
    double& end_m = length_m >= 0.0 ? hanging_m : standing_m;
    Marker bar = makeMarker(header, "components", Marker::CUBE, color);
    bar.id = 100 + id;
    bar.scale.x = bar.scale.y = 0.22;
    bar.scale.z = std::max(std::abs(length_m), 1.0e-3);  // rviz refuses a scale of 0
    bar.pose.position.x = kBarOffsetM;
    bar.pose.position.z = -(end_m + 0.5 * length_m);
    end_m += length_m;
    markers.push_back(bar);

    char text[64];
    const double tenths_kn = std::round(1.0e-2 * part.force_n) + 0.0;  // + 0: no "-0.0"
    std::snprintf(text, sizeof text, "%s %.1f kN", part.label, 0.1 * tenths_kn);
    markers.push_back(makeLine(header, "components", id, kRightOfPole, text, color));
    ++id;
  }
}

/// The outline and its name, which is a line of text of its colour; both are deleted where there is no such outline.
struct Outline {
  const char* name;  ///< namespace of its markers
  const char* label;
  const std::vector<Eigen::Vector3d>& polygon;
  std_msgs::ColorRGBA color;
};

void appendOutline(const std_msgs::Header& map, const std_msgs::Header& load_cell, const Outline& outline, int row,
                   std::vector<Marker>& markers) {
  Marker line = makeMarker(map, outline.name, Marker::LINE_STRIP, outline.color);
  Marker label = makeLine(load_cell, outline.name, row, kLeftOfPole, outline.label, outline.color);
  if (outline.polygon.empty()) {
    line.action = label.action = Marker::DELETE;
  } else {
    line.scale.x = kOutlineWidthM;
    for (const Eigen::Vector3d& corner : outline.polygon) {
      line.points.push_back(toPoint({corner.x(), corner.y(), corner.z() + 0.5 * kOutlineWidthM}));
    }
    line.points.push_back(line.points.front());
  }
  markers.push_back(line);
  markers.push_back(label);
}

}  // namespace

std::array<ForcePart, 5> splitTension(const Snapshot& snapshot) {
  const ForceBalance& part = snapshot.components;
  return {{{"rig in water", part.weight_n - part.buoyancy_n, {0.70F, 0.72F, 0.75F}},
           {"ice in water", part.plug_gravity_n - part.plug_buoyancy_n, {0.45F, 0.75F, 1.00F}},
           {"friction, cohesion", part.plug_friction_n, {1.00F, 0.62F, 0.20F}},
           {"drag", part.plug_drag_n, {0.35F, 0.85F, 0.55F}},
           {"inertia", part.inertia_n, {0.85F, 0.55F, 0.90F}}}};
}

visualization_msgs::MarkerArray toMarkers(const Stamp& stamp, const Scenario& scenario, const Snapshot& snapshot,
                                          const PlugOutline& plug, double metres_per_newton) {
  const auto map = stamp.header(frames::kMap);
  const auto load_cell = stamp.header(frames::kLoadCell);
  visualization_msgs::MarkerArray array;

  // Wider than the ice, so that a rim of open water frames the field.
  Marker water = makeMarker(map, "water", Marker::CUBE, makeColor(0.15F, 0.45F, 0.65F, 0.6F));
  water.scale.x = 1.2 * scenario.field.length_x_m;
  water.scale.y = 1.2 * scenario.field.length_y_m;
  water.scale.z = 0.01;
  array.markers.push_back(water);
  array.markers.push_back(makeNet(stamp.header(frames::kCollector), scenario.collector, snapshot.rig));

  array.markers.push_back(makeForceArrow(load_cell, lengthOf(snapshot.force_n, metres_per_newton)));
  appendComponents(load_cell, snapshot, metres_per_newton, array.markers);
  Marker text = makeMarker(load_cell, "text", Marker::TEXT_VIEW_FACING, makeColor(1.0F, 1.0F, 1.0F, 1.0F));
  text.scale.z = kLineHeightM;
  text.pose.position.z = 1.2;
  char line[96];
  std::snprintf(line, sizeof line, "%s  t = %.1f s\n%.1f kN", stageName(snapshot.stage), snapshot.time_s,
                1.0e-3 * snapshot.force_n);
  text.text = line;
  array.markers.push_back(text);

  int row = 0;
  for (const Outline& outline :
       {Outline{"plug_top", "plug, top", plug.top, makeColor(1.0F, 0.9F, 0.1F, 1.0F)},
        Outline{"plug_waterline", "plug, waterline", plug.waterline, makeColor(0.0F, 0.75F, 0.9F, 1.0F)},
        Outline{"hole", "hole", plug.hole, makeColor(0.95F, 0.2F, 0.3F, 1.0F)}}) {
    appendOutline(map, load_cell, outline, row++, array.markers);
  }
  return array;
}

}  // namespace brash_ice_rig
