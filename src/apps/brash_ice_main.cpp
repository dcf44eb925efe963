// brash_ice: runs and checks pull-up scenarios without ROS.

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/output/run_writer.h"
#include "brash_ice_rig/output/vtk_writer.h"
#include "brash_ice_rig/simulation/simulation.h"
#include "brash_ice_rig/simulation/waiting_threads.h"
#include "brash_ice_rig/version.h"

namespace brash_ice_rig {
namespace {

// Scripts rely on these.
constexpr int kExitDone = 0;
constexpr int kExitRunFailed = 1;
constexpr int kExitBadInput = 2;

volatile std::sig_atomic_t stop_requested = 0;

void requestStop(int) {
  stop_requested = 1;
}

using WallClock = std::chrono::steady_clock;

double secondsSince(WallClock::time_point start) {
  return std::chrono::duration<double>(WallClock::now() - start).count();
}

/// Simulated time that the script will take, settling included, s. An estimate: it leaves out the crane's ramps.
double expectedDuration(const Scenario& scenario) {
  const ProcedureConfig& procedure = scenario.procedure;
  double duration_s = procedure.settle_duration_s + procedure.lift_duration_s + procedure.hold_duration_s;
  if (procedure.start == StartPose::kFoldedAboveIce) {
    const double way_m = startHubHeight(scenario) - lowestHubHeight(scenario);
    duration_s += way_m / procedure.lower_speed_mps;
    duration_s += scenario.collector.unfold_duration_s;
  }
  return duration_s;
}

/// Tells on stderr how far the run is: a bar on a terminal; otherwise a line every 2 s and at each change of stage.
class Progress {
 public:
  explicit Progress(const Scenario& scenario)
      : terminal_(isatty(STDERR_FILENO) != 0),
        settle_s_(scenario.procedure.settle_duration_s),
        total_s_(expectedDuration(scenario)) {}

  void show(const Snapshot& snapshot) {
    const double wall_s = secondsSince(start_);
    if (snapshot.stage == shown_stage_ && wall_s - shown_wall_s_ < (terminal_ ? 0.1 : 2.0)) return;
    shown_wall_s_ = wall_s;
    shown_stage_ = snapshot.stage;
    std::fprintf(stderr, "%s%-7s t %7.2f s   hub %+6.2f m   force %8.0f N", terminal_ ? "\r" : "",
                 stageName(snapshot.stage), snapshot.time_s, snapshot.rig.hoist_position_m, snapshot.force_n);
    if (terminal_) showBar(std::clamp((snapshot.time_s + settle_s_) / total_s_, 0.0, 1.0), wall_s);
    std::fputs(terminal_ ? "\033[K" : "\n", stderr);
    std::fflush(stderr);
  }

  void end() const {
    if (terminal_) std::fputs("\n", stderr);
  }

 private:
  static void showBar(double done, double wall_s) {
    constexpr int kWidth = 24;
    const int filled = static_cast<int>(std::lround(done * kWidth));
    std::fprintf(stderr, "   [%s%s] %3.0f %%", std::string(filled, '#').c_str(),
                 std::string(kWidth - filled, '.').c_str(), 100.0 * done);
    // The first moments say little about the rest.
    if (done < 0.01) return;
    const auto left_s = static_cast<long>(std::ceil(wall_s * (1.0 - done) / done));
    std::fprintf(stderr, "  %ld:%02ld left", left_s / 60, left_s % 60);
  }

  bool terminal_;
  double settle_s_, total_s_;
  WallClock::time_point start_ = WallClock::now();
  double shown_wall_s_ = -std::numeric_limits<double>::infinity();
  Stage shown_stage_ = Stage::kSettle;
};

int run(const ScenarioSources& sources, const std::string& directory) {
  const Scenario scenario = loadScenario(sources);
  if (scenario.procedure.control == ControlMode::kManual) {
    throw ConfigError("procedure.control", "manual", "has no end; `brash_ice run` needs scripted", sources.file);
  }
  Simulation simulation(scenario);
  RunWriter writer(simulation, directory);
  std::optional<VtkWriter> vtk;
  if (scenario.output.vtk_interval_s > 0.0) vtk.emplace(directory + "/vtk");

  std::signal(SIGINT, requestStop);
  std::signal(SIGTERM, requestStop);
  Progress progress(scenario);
  RunTiming timing;
  if (vtk) vtk->writeIfDue(simulation, simulation.snapshot());
  const auto start = WallClock::now();
  while (!simulation.finished() && stop_requested == 0) {
    const auto before = WallClock::now();
    const StepReport report = simulation.advance(simulation.samplePeriod());
    timing.compute_s += secondsSince(before);
    const Snapshot snapshot = simulation.snapshot();
    writer.write(snapshot, report.flags);
    if (vtk) vtk->writeIfDue(simulation, snapshot);
    progress.show(snapshot);
  }
  timing.wall_s = secondsSince(start);
  progress.end();

  const bool interrupted = !simulation.finished();
  const RunSummary summary = writer.finish(simulation, timing, interrupted);
  std::printf("%s\n%s\n%s\n%s\n", describe(summary).c_str(), writer.scenarioPath().c_str(), writer.forcePath().c_str(),
              writer.summaryPath().c_str());
  if (vtk) std::printf("%s\n", vtk->collectionPath().c_str());
  return interrupted || simulation.frozen() ? kExitRunFailed : kExitDone;
}

int check(const std::vector<std::string>& files) {
  int code = kExitDone;
  for (const std::string& file : files) {
    try {
      ScenarioSources sources;
      sources.file = file;
      loadScenario(sources);
      std::printf("%s: ok\n", file.c_str());
    } catch (const ConfigError& error) {
      std::fprintf(stderr, "%s\n", error.what());
      code = kExitBadInput;
    }
  }
  return code;
}

int runProgram(int argc, char** argv) {
  CLI::App app("Brash-ice pull-up rig: simulates the test that a scenario describes.", "brash_ice");
  app.require_subcommand(1);
  app.add_flag_callback(
      "--version",
      [] {
        std::printf("brash_ice %s\n", kVersion);
        throw CLI::Success();
      },
      "Print the version and exit");
  app.footer("Exit codes: 0 done, 1 run failed or interrupted, 2 bad input.");

  ScenarioSources sources;
  std::string directory, threads, vtk_interval_s;
  CLI::App* run_command = app.add_subcommand("run", "Run a scenario; leave force.csv, scenario.yaml and summary.json");
  run_command->add_option("scenario", sources.file, "Scenario YAML")->required()->type_name("SCENARIO");
  run_command->add_option("--set", sources.settings, "Change one key; may be given many times")
      ->allow_extra_args(false)  // one value per --set, so that SCENARIO may follow
      ->type_name("SECTION.KEY=VALUE");
  run_command->add_option("--overlay", sources.overlays, "YAML with changed keys; may be given many times")
      ->allow_extra_args(false)
      ->type_name("FILE");
  run_command->add_option("--out", directory, "Directory for the results (default: name of the scenario + _run)")
      ->type_name("DIR");
  run_command->add_option("--threads", threads, "The same as --set solver.threads=N")->type_name("N");
  run_command->add_option("--vtk", vtk_interval_s, "The same as --set output.vtk_interval_s=SECONDS")
      ->type_name("SECONDS");

  std::vector<std::string> files;
  CLI::App* check_command = app.add_subcommand("check", "Validate scenarios and overlays without running them");
  check_command->add_option("files", files, "Scenario or overlay YAML")->required()->type_name("FILE");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitDone : kExitBadInput;
  }
  if (check_command->parsed()) return check(files);

  if (!threads.empty()) sources.settings.push_back("solver.threads=" + threads);
  if (!vtk_interval_s.empty()) sources.settings.push_back("output.vtk_interval_s=" + vtk_interval_s);
  if (directory.empty()) directory = std::filesystem::path(sources.file).stem().string() + "_run";
  return run(sources, directory);
}

/// A file that is opened while a standard stream is closed takes its place, and progress lines end up in force.csv.
void occupyClosedStreams() {
  int descriptor = open("/dev/null", O_RDWR);
  while (descriptor >= 0 && descriptor <= STDERR_FILENO) descriptor = dup(descriptor);
  if (descriptor >= 0) close(descriptor);
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  using namespace brash_ice_rig;
  occupyClosedStreams();
  letWaitingThreadsSleep(argv);
  try {
    return runProgram(argc, argv);
  } catch (const ConfigError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitBadInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "run failed: %s\n", error.what());
    return kExitRunFailed;
  }
}
