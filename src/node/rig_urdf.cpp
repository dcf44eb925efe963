#include "brash_ice_rig/node/rig_urdf.h"

#include <cmath>
#include <locale>
#include <sstream>

#include "brash_ice_rig/math/angle.h"
#include "brash_ice_rig/node/topic_names.h"
#include "brash_ice_rig/rig/collector.h"

namespace brash_ice_rig {
namespace {

/// Writes the elements of one URDF; lengths in m, angles in rad.
class UrdfText {
 public:
  explicit UrdfText(const std::string& frame_prefix) : prefix_(frame_prefix) {
    text_.imbue(std::locale::classic());
    text_.precision(12);
    text_ << "<?xml version=\"1.0\"?>\n<robot name=\"brash_ice_rig\">\n";
    material("steel", "0.45 0.47 0.50 1");
    material("hub", "0.85 0.30 0.10 1");
    material("sensor", "0.95 0.75 0.10 1");
  }

  void emptyLink(const std::string& name) { text_ << "  <link name=\"" << prefix_ << name << "\"/>\n"; }

  void boxLink(const std::string& name, double width_m, double height_m, double centre_z_m, const char* material) {
    beginVisual(name, 0.0, centre_z_m, 0.0);
    text_ << "<box size=\"" << width_m << ' ' << width_m << ' ' << height_m << "\"/>";
    endVisual(material);
  }

  /// @param pitch_rad  turns the cylinder's axis from z towards x
  void cylinderLink(const std::string& name, double radius_m, double length_m, double centre_x_m, double centre_z_m,
                    double pitch_rad, const char* material) {
    beginVisual(name, centre_x_m, centre_z_m, pitch_rad);
    text_ << "<cylinder radius=\"" << radius_m << "\" length=\"" << length_m << "\"/>";
    endVisual(material);
  }

  void fixedJoint(const std::string& name, const std::string& parent, const std::string& child, double z_m) {
    beginJoint(name, "fixed", parent, child, z_m, 0.0);
    text_ << "  </joint>\n";
  }

  void movingJoint(const std::string& name, const char* type, const std::string& parent, const std::string& child,
                   double z_m, double yaw_rad, const char* axis, double lower, double upper, double speed) {
    beginJoint(name, type, parent, child, z_m, yaw_rad);
    text_ << "    <axis xyz=\"" << axis << "\"/>\n    <limit lower=\"" << lower << "\" upper=\"" << upper
          << "\" velocity=\"" << speed << "\" effort=\"1e6\"/>\n  </joint>\n";
  }

  std::string finish() {
    text_ << "</robot>\n";
    return text_.str();
  }

 private:
  void material(const char* name, const char* rgba) {
    text_ << "  <material name=\"" << name << "\"><color rgba=\"" << rgba << "\"/></material>\n";
  }

  void beginVisual(const std::string& name, double x_m, double z_m, double pitch_rad) {
    text_ << "  <link name=\"" << prefix_ << name << "\">\n    <visual>\n      <origin xyz=\"" << x_m << " 0 " << z_m
          << "\" rpy=\"0 " << pitch_rad << " 0\"/>\n      <geometry>";
  }

  void endVisual(const char* material) {
    text_ << "</geometry>\n      <material name=\"" << material << "\"/>\n    </visual>\n  </link>\n";
  }

  void beginJoint(const std::string& name, const char* type, const std::string& parent, const std::string& child,
                  double z_m, double yaw_rad) {
    text_ << "  <joint name=\"" << name << "\" type=\"" << type << "\">\n    <parent link=\"" << prefix_ << parent
          << "\"/>\n    <child link=\"" << prefix_ << child << "\"/>\n    <origin xyz=\"0 0 " << z_m << "\" rpy=\"0 0 "
          << yaw_rad << "\"/>\n";
  }

  std::string prefix_;
  std::ostringstream text_;
};

}  // namespace

std::string makeRigUrdf(const Scenario& scenario, const std::string& frame_prefix) {
  const CollectorConfig& collector = scenario.collector;
  const CraneConfig& crane = scenario.crane;
  const double arm_length_m = armLength(collector);
  const double arm_radius_m = 0.02 * collector.radius_m;
  const double hub_height_m = 0.12 * collector.radius_m;

  UrdfText urdf(frame_prefix);
  urdf.emptyLink(frames::kMap);
  urdf.emptyLink(frames::kCarriageX);
  urdf.emptyLink(frames::kCarriageY);
  urdf.boxLink(frames::kCraneTip, 0.4, 0.2, 0.35, "steel");
  urdf.cylinderLink(frames::kLoadCell, 0.12, 0.25, 0.0, 0.125, 0.0, "sensor");
  urdf.cylinderLink(frames::kPole, collector.pole_radius_m, collector.pole_length_m, 0.0,
                    -0.5 * collector.pole_length_m, 0.0, "steel");
  urdf.cylinderLink(frames::kCollector, 0.1 * collector.radius_m, hub_height_m, 0.0, 0.0, 0.0, "hub");

  urdf.movingJoint(joints::kBoomX, "prismatic", frames::kMap, frames::kCarriageX, 0.0, 0.0, "1 0 0", -crane.max_reach_m,
                   crane.max_reach_m, crane.max_speed_mps);
  urdf.movingJoint(joints::kBoomY, "prismatic", frames::kCarriageX, frames::kCarriageY, 0.0, 0.0, "0 1 0",
                   -crane.max_reach_m, crane.max_reach_m, crane.max_speed_mps);
  urdf.movingJoint(joints::kHoist, "prismatic", frames::kCarriageY, frames::kCraneTip, collector.pole_length_m, 0.0,
                   "0 0 1", crane.min_height_m - collector.pole_length_m, crane.max_height_m - collector.pole_length_m,
                   crane.max_speed_mps);
  urdf.fixedJoint("load_cell_mount", frames::kCraneTip, frames::kLoadCell, 0.0);
  urdf.fixedJoint("pole_mount", frames::kLoadCell, frames::kPole, 0.0);
  urdf.fixedJoint("collector_mount", frames::kPole, frames::kCollector, -collector.pole_length_m);

  for (int arm = 0; arm < kArmCount; ++arm) {
    const std::string link = frames::kArmStem + std::to_string(arm + 1);
    urdf.cylinderLink(link, arm_radius_m, arm_length_m, 0.5 * arm_length_m, 0.0, 0.5 * kPi, "steel");
    // A turn about -y lifts the arm's x axis.
    urdf.movingJoint(joints::kArms[static_cast<std::size_t>(arm)], "revolute", frames::kCollector, link, 0.0,
                     arm * 2.0 * kPi / kArmCount, "0 -1 0", -0.5 * kPi, 0.5 * kPi, 1.0);
  }
  return urdf.finish();
}

}  // namespace brash_ice_rig
