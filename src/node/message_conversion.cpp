#include "brash_ice_rig/node/message_conversion.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>

#include "brash_ice_rig/node/topic_names.h"

namespace brash_ice_rig {
namespace {

constexpr bool sameBit(std::uint32_t message_value, StatusFlag flag) {
  return message_value == static_cast<std::uint32_t>(flag);
}
static_assert(sameBit(SimStatus::OVERLOAD, StatusFlag::kOverload), "SimStatus.msg and status.h differ");
static_assert(sameBit(SimStatus::COMMAND_TIMEOUT, StatusFlag::kCommandTimeout), "SimStatus.msg and status.h differ");
static_assert(sameBit(SimStatus::SPEED_LIMITED, StatusFlag::kSpeedLimited), "SimStatus.msg and status.h differ");
static_assert(sameBit(SimStatus::TRAVEL_LIMIT, StatusFlag::kTravelLimit), "SimStatus.msg and status.h differ");
static_assert(sameBit(SimStatus::COMMAND_REJECTED, StatusFlag::kCommandRejected), "SimStatus.msg and status.h differ");
static_assert(sameBit(SimStatus::COMMAND_IGNORED, StatusFlag::kCommandIgnored), "SimStatus.msg and status.h differ");
static_assert(sameBit(SimStatus::MULTIPLE_COMMANDERS, StatusFlag::kMultipleCommanders),
              "SimStatus.msg and status.h differ");
static_assert(sameBit(SimStatus::FOLD_JAMMED, StatusFlag::kFoldJammed), "SimStatus.msg and status.h differ");
static_assert(sameBit(SimStatus::FOLD_UNLOCKED, StatusFlag::kFoldUnlocked), "SimStatus.msg and status.h differ");
static_assert(sameBit(SimStatus::CONTACT_SATURATED, StatusFlag::kContactSaturated),
              "SimStatus.msg and status.h differ");
static_assert(sameBit(SimStatus::NON_FINITE, StatusFlag::kNonFinite), "SimStatus.msg and status.h differ");
static_assert(sameBit(SimStatus::HOIST_SLACK, StatusFlag::kHoistSlack), "SimStatus.msg and status.h differ");

geometry_msgs::Vector3 toVector(const Eigen::Vector3d& vector) {
  geometry_msgs::Vector3 message;
  message.x = vector.x();
  message.y = vector.y();
  message.z = vector.z();
  return message;
}

}  // namespace

geometry_msgs::Point toPoint(const Eigen::Vector3d& position_m) {
  geometry_msgs::Point point;
  point.x = position_m.x();
  point.y = position_m.y();
  point.z = position_m.z();
  return point;
}

std_msgs::Header Stamp::header(const char* frame) const {
  std_msgs::Header header;
  header.stamp = time;
  header.frame_id = frame_prefix + frame;
  return header;
}

geometry_msgs::WrenchStamped toWrench(const Stamp& stamp, const Eigen::Vector3d& force_n) {
  geometry_msgs::WrenchStamped wrench;
  wrench.header = stamp.header(frames::kLoadCell);
  wrench.wrench.force = toVector(force_n);
  return wrench;
}

ForceComponents toForceComponents(const Stamp& stamp, const Snapshot& snapshot) {
  const ForceBalance& part = snapshot.components;
  ForceComponents message;
  message.header = stamp.header(frames::kMap);
  message.time_s = snapshot.time_s;
  message.tension_n = snapshot.tension_n;
  message.weight_n = part.weight_n;
  message.buoyancy_n = part.buoyancy_n;
  message.ice_normal_n = part.ice_normal_n;
  message.ice_friction_n = part.ice_friction_n;
  message.inertia_n = part.inertia_n;
  message.plug_gravity_n = part.plug_gravity_n;
  message.plug_buoyancy_n = part.plug_buoyancy_n;
  message.plug_drag_n = part.plug_drag_n;
  message.plug_friction_n = part.plug_friction_n;
  message.ice_force_n = toVector(snapshot.ice_force_n);
  return message;
}

PlugState toPlugState(const Stamp& stamp, double time_s, const PlugSummary& plug) {
  PlugState message;
  message.header = stamp.header(frames::kMap);
  message.time_s = time_s;
  message.lifted_mass_kg = plug.lifted_mass_kg;
  message.raised_particles = static_cast<std::uint32_t>(plug.raised_particles);
  message.radius_at_waterline_m = plug.radius_at_waterline_m;
  message.radius_at_top_m = plug.radius_at_top_m;
  message.hole_sites = static_cast<std::uint32_t>(plug.hole_sites);
  message.hole_refill_ratio = plug.hole_refill_ratio;
  message.hole_cover_ratio = plug.hole_cover_ratio;
  message.bulge_height_m = plug.bulge_height_m;
  message.bulge_radius_m = plug.bulge_radius_m;
  return message;
}

CraneState toCraneState(const Stamp& stamp, const Snapshot& snapshot) {
  const RigState& rig = snapshot.rig;
  CraneState message;
  message.header = stamp.header(frames::kMap);
  message.stage = stageName(snapshot.stage);
  message.time_s = snapshot.time_s;
  message.position_m = toPoint(rig.crane_position_m);
  message.velocity_mps = toVector(rig.crane_velocity_mps);
  message.commanded_velocity_mps = toVector(rig.commanded_velocity_mps);
  message.hoist_position_m = rig.hoist_position_m;
  message.fold_ratio = rig.fold_ratio;
  message.fold_target = rig.fold_target;
  message.arm_angle_rad = rig.arm_angle_rad;
  message.locked = rig.locked;
  message.command_timed_out = snapshot.flags.has(StatusFlag::kCommandTimeout);
  message.speed_limited = snapshot.flags.has(StatusFlag::kSpeedLimited);
  message.travel_limited = snapshot.flags.has(StatusFlag::kTravelLimit);
  return message;
}

TakenCommand toTakenCommand(const Stamp& stamp, const RigCommand& command, std::uint32_t index) {
  TakenCommand message;
  message.header = stamp.header(frames::kMap);
  message.time_s = command.time_s;
  message.index = index;
  message.has_velocity = command.velocity_mps.has_value();
  if (command.velocity_mps) message.velocity_mps = toVector(*command.velocity_mps);
  message.has_fold_target = command.fold_target.has_value();
  message.fold_target = command.fold_target.value_or(0.0);
  message.tare = command.tare;
  message.has_load_cell_noise = command.load_cell_noise_n.has_value();
  message.load_cell_noise_n = command.load_cell_noise_n.value_or(0.0);
  message.has_load_cell_resolution = command.load_cell_resolution_n.has_value();
  message.load_cell_resolution_n = command.load_cell_resolution_n.value_or(0.0);
  return message;
}

geometry_msgs::TwistStamped toCommandOut(const Stamp& stamp, const RigState& rig) {
  geometry_msgs::TwistStamped message;
  message.header = stamp.header(frames::kCraneTip);
  message.twist.linear = toVector(rig.commanded_velocity_mps);
  return message;
}

sensor_msgs::JointState toJointState(const Stamp& stamp, const Snapshot& snapshot) {
  const RigState& rig = snapshot.rig;
  sensor_msgs::JointState message;
  message.header.stamp = stamp.time;
  message.name = {joints::kBoomX, joints::kBoomY, joints::kHoist};
  message.position = {rig.crane_position_m.x(), rig.crane_position_m.y(), rig.hoist_position_m};
  message.velocity = {rig.crane_velocity_mps.x(), rig.crane_velocity_mps.y(), rig.crane_velocity_mps.z()};
  message.effort = {0.0, 0.0, snapshot.tension_n};
  for (const char* arm : joints::kArms) {
    message.name.emplace_back(arm);
    message.position.push_back(rig.arm_angle_rad);
    message.velocity.push_back(0.0);
    message.effort.push_back(0.0);
  }
  return message;
}

sensor_msgs::PointCloud2 toPointCloud(const Stamp& stamp, const ParticleCloud& particles, const LiveOptions& options) {
  struct Column {
    const char* name;
    const std::vector<float>& values;
  };
  std::vector<Column> columns = {{"x", particles.x_m}, {"y", particles.y_m}, {"z", particles.z_m}};
  if (options.points_speed) columns.push_back({"speed", particles.speed_mps});
  if (options.points_pressure) columns.push_back({"pressure", particles.pressure_pa});
  if (options.points_plastic_strain) columns.push_back({"plastic_strain", particles.plastic_strain});
  if (options.points_damage) columns.push_back({"damage", particles.damage});
  if (options.points_submerged) columns.push_back({"submerged", particles.submerged});
  sensor_msgs::PointCloud2 cloud;
  cloud.header = stamp.header(frames::kMap);
  cloud.height = 1;
  cloud.width = static_cast<std::uint32_t>(particles.size());
  cloud.point_step = static_cast<std::uint32_t>(columns.size() * sizeof(float));
  cloud.row_step = cloud.width * cloud.point_step;
  cloud.is_bigendian = false;
  cloud.is_dense = true;
  cloud.data.resize(cloud.row_step);
  for (std::size_t c = 0; c < columns.size(); ++c) {
    assert(columns[c].values.size() == particles.size());
    sensor_msgs::PointField field;
    field.name = columns[c].name;
    field.offset = static_cast<std::uint32_t>(c * sizeof(float));
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    cloud.fields.push_back(field);
    std::uint8_t* target = cloud.data.data() + field.offset;
    for (const float value : columns[c].values) {
      std::memcpy(target, &value, sizeof(float));
      target += cloud.point_step;
      if (!std::isfinite(value)) cloud.is_dense = false;
    }
  }
  return cloud;
}

void setFlags(StatusFlags flags, const std::string& breakdown, SimStatus& status) {
  status.flags = flags.bits();
  status.flag_names.clear();
  status.remedies.clear();
  for (const StatusFlag flag : activeFlags(flags)) {
    status.flag_names.emplace_back(statusName(flag));
    status.remedies.emplace_back(statusRemedy(flag));
    if (flag == StatusFlag::kNonFinite && !breakdown.empty()) status.remedies.back() += " " + breakdown;
  }
}

}  // namespace brash_ice_rig
