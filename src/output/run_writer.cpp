#include "brash_ice_rig/output/run_writer.h"

#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <system_error>

#include "brash_ice_rig/config/scenario_reader.h"

namespace brash_ice_rig {
namespace {

constexpr const char* kHeader =
    "time_s,force_n,hoist_position_m,hoist_speed_mps,fold_ratio,stage,"
    "tension_n,ice_force_x_n,ice_force_y_n,ice_force_z_n,"
    "weight_n,buoyancy_n,ice_normal_n,ice_friction_n,inertia_n,"
    "plug_gravity_n,plug_buoyancy_n,plug_drag_n,plug_friction_n,"
    "force_x_n,force_y_n,hoist_command_mps\n";

constexpr const char* kPlugHeader =
    "time_s,lifted_mass_kg,raised_particles,radius_at_waterline_m,radius_at_top_m,hole_sites,hole_refill_ratio,"
    "hole_cover_ratio,bulge_height_m,bulge_radius_m\n";

/// Time between two rows of plug.csv, s.
constexpr double kPlugIntervalS = 0.5;

void append(std::string& row, std::initializer_list<double> values) {
  for (const double value : values) {
    if (!row.empty()) row += ',';
    row += toText(value);
  }
}

std::string rowOf(const Snapshot& snapshot) {
  std::string row;
  append(row, {snapshot.time_s, snapshot.force_n, snapshot.rig.hoist_position_m, snapshot.rig.crane_velocity_mps.z(),
               snapshot.rig.fold_ratio});
  row += ',';
  row += stageName(snapshot.stage);
  const auto& part = snapshot.components;
  append(row,
         {snapshot.tension_n, snapshot.ice_force_n.x(), snapshot.ice_force_n.y(), snapshot.ice_force_n.z(),
          part.weight_n, part.buoyancy_n, part.ice_normal_n, part.ice_friction_n, part.inertia_n, part.plug_gravity_n,
          part.plug_buoyancy_n, part.plug_drag_n, part.plug_friction_n, snapshot.load_cell_force_n.x(),
          snapshot.load_cell_force_n.y(), snapshot.rig.commanded_velocity_mps.z()});
  return row + '\n';
}

std::string energyHeader() {
  std::string row = "time_s";
  for (const EnergyTerm& term : kEnergyTerms) row += std::string(",") + term.name;
  return row + ",rig_imbalance_j,contact_imbalance_j,ice_imbalance_j\n";
}

std::string energyRow(double time_s, const EnergyBalance& energy) {
  std::string row = toText(time_s);
  for (const EnergyTerm& term : kEnergyTerms) append(row, {energy.*term.value});
  append(row, {energy.rigImbalance(), energy.contactImbalance(), energy.iceImbalance()});
  return row + '\n';
}

/// Makes the directory ready for a new run and returns it.
std::string prepare(const std::string& directory) {
  makeDirectory(directory);
  for (const char* name : {"/summary.json", "/energy.csv"}) {
    std::error_code error;
    std::filesystem::remove(directory + name, error);
    if (error) throw OutputError(directory + name, error.message());
  }
  return directory;
}

/// The rows of a table so far: read back from its file, so that they need no memory during the run.
void visitRows(StateVisitor& visitor, OutputFile& file, const std::string& header) {
  std::string rows;
  if (!visitor.loading()) {
    file.flush();
    rows = textOfFile(file.path());
    rows.erase(0, header.size());
  }
  std::string columns = header;
  visitor("header", columns);
  if (columns != header) visitor.refuse(file.path() + " would have other columns");
  visitor("rows", rows);
  if (!visitor.loading()) return;
  file.write(rows);
  file.flush();
}

}  // namespace

RunWriter::RunWriter(const Simulation& simulation, const std::string& directory)
    : directory_(prepare(directory)),
      force_file_(forcePath(), OutputFile::Mode::kDirect),
      plug_file_(plugPath(), OutputFile::Mode::kDirect),
      reading_(simulation.samplePeriod()),
      ice_(simulation.samplePeriod()),
      sample_period_s_(simulation.samplePeriod()),
      first_step_(simulation.stepCount()),
      first_active_particle_steps_(simulation.activeParticleSteps()) {
  energy_ = simulation.snapshot().energy;
  OutputFile scenario_file(scenarioPath(), OutputFile::Mode::kReplace);
  scenario_file.write(toYaml(simulation.scenario()));
  scenario_file.close();
  force_file_.write(kHeader);
  force_file_.flush();
  plug_file_.write(kPlugHeader);
  plug_file_.flush();
  if (simulation.scenario().output.energy) {
    energy_file_.emplace(energyPath(), OutputFile::Mode::kDirect);
    energy_file_->write(energyHeader());
    energy_file_->flush();
  }
}

void RunWriter::visitState(StateVisitor& visitor) {
  visitRows(visitor, force_file_, kHeader);
  visitRows(visitor, plug_file_, kPlugHeader);
  if (energy_file_) visitRows(visitor, *energy_file_, energyHeader());
  reading_.visitState(visitor);
  ice_.visitState(visitor);
  flags_.visitState(visitor);
  visitor("first_step", first_step_);
  visitor("first_active_particle_steps", first_active_particle_steps_);
  visitor("plug_due_s", plug_due_s_);
}

void RunWriter::write(const Snapshot& snapshot, StatusFlags raised) {
  flags_ |= snapshot.flags;
  flags_ |= raised;
  force_file_.write(rowOf(snapshot));
  energy_ = snapshot.energy;
  if (energy_file_ && energy_) energy_file_->write(energyRow(snapshot.time_s, *energy_));
  // Once per simulated second: a reader can follow, and a full disk shows early.
  if (static_cast<double>(++rows_since_flush_) * sample_period_s_ >= 1.0) {
    force_file_.flush();
    if (energy_file_) energy_file_->flush();
    rows_since_flush_ = 0;
  }
  // Half a period: the end of settling is time 0 only to round-off.
  if (snapshot.time_s < -0.5 * sample_period_s_ || snapshot.stage == Stage::kDone) return;
  reading_.add(snapshot.time_s, snapshot.force_n);
  ice_.add(snapshot.time_s, snapshot.components.ice_normal_n + snapshot.components.ice_friction_n);
}

void RunWriter::writePlugIfDue(const Simulation& simulation, const Snapshot& snapshot) {
  if (snapshot.time_s < plug_due_s_ - 0.5 * sample_period_s_) return;
  plug_due_s_ = nextMultiple(kPlugIntervalS, snapshot.time_s + 0.5 * sample_period_s_);
  const PlugSummary plug = simulation.plug();
  std::string row;
  append(row, {snapshot.time_s, plug.lifted_mass_kg, static_cast<double>(plug.raised_particles),
               plug.radius_at_waterline_m, plug.radius_at_top_m, static_cast<double>(plug.hole_sites),
               plug.hole_refill_ratio, plug.hole_cover_ratio, plug.bulge_height_m, plug.bulge_radius_m});
  plug_file_.write(row + '\n');
  plug_file_.flush();
}

RunSummary RunWriter::finish(const Simulation& simulation, const RunTiming& timing, bool interrupted) {
  force_file_.close();
  plug_file_.close();
  if (energy_file_) energy_file_->close();
  RunSummary summary;
  summary.peak_force_n = reading_.peak();
  summary.peak_time_s = reading_.peakTime();
  summary.residual_force_n = reading_.residual();
  summary.ice_peak_force_n = ice_.peak();
  summary.ice_residual_force_n = ice_.residual();
  if (energy_) {
    summary.energy_crane_work_j = energy_->crane_work_j;
    summary.energy_imbalance_ratio = energy_->imbalanceRatio();
  }
  summary.particle_count = simulation.particleCount();
  summary.step_count = simulation.stepCount() - first_step_;
  summary.dt_s = simulation.timeStep();
  const double steps = static_cast<double>(summary.step_count);
  summary.active_ratio = static_cast<double>(simulation.activeParticleSteps() - first_active_particle_steps_) /
                         (steps * static_cast<double>(summary.particle_count));
  summary.simulated_s = steps * summary.dt_s;
  summary.wall_s = timing.wall_s;
  summary.real_time_factor = summary.simulated_s / timing.wall_s;
  summary.ns_per_particle_step = 1.0e9 * timing.compute_s / (steps * static_cast<double>(summary.particle_count));
  summary.threads = simulation.scenario().solver.threads;
  summary.state_hash = simulation.stateHash();
  summary.status = statusText(flags_, interrupted, simulation.breakdown());

  OutputFile summary_file(summaryPath(), OutputFile::Mode::kReplace);
  summary_file.write(toJson(summary));
  summary_file.close();
  return summary;
}

}  // namespace brash_ice_rig
