// step_bench: times stretches of one simulation. scripts/bench drives it; doc/performance.md says what the figures
// mean.
//
//   step_bench SCENARIO [--overlay FILE]... [--set KEY=VALUE]... [--all-active]
//
// Writes one line of JSON about the simulation. Then, for each line "AT_S DURATION_S" on standard input: runs on to the
// simulated time AT_S, which takes as long as it takes, runs for another DURATION_S with the clock on, and writes one
// line of JSON. Both times in s, AT_S as in a snapshot: 0 is the end of settling. Between two lines it waits, so that
// other programs can be timed in turns with it. Exit codes: 0 done, 1 run failed, 2 bad input.

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/simulation/simulation.h"
#include "brash_ice_rig/simulation/waiting_threads.h"
#include "brash_ice_rig/version.h"

namespace brash_ice_rig {
namespace {

#if defined(__clang__)
constexpr const char* kCompiler = "clang " __clang_version__;
#else
constexpr const char* kCompiler = "gcc " __VERSION__;
#endif

/// Processor time of all threads of this process, s.
double processorTime() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1.0e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// Largest memory that this program has had, bytes. Not from getrusage(): there a child starts from what its parent
/// had.
double peakMemory() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    double kibibytes = 0.0;
    if (std::sscanf(line.c_str(), "VmHWM: %lf kB", &kibibytes) == 1) return 1024.0 * kibibytes;
  }
  throw std::runtime_error("/proc/self/status does not tell the memory");
}

/// @param all_active  switch off what leaves resting particles out of the step, where the program has such a key
Scenario makeScenario(ScenarioSources sources, bool all_active) {
  Scenario scenario = loadScenario(sources);
  const std::string key = "solver.active_set";
  const auto keys = keyValues(scenario);
  const auto is_key = [&key](const auto& entry) { return entry.first == key; };
  if (!all_active || std::none_of(keys.begin(), keys.end(), is_key)) return scenario;
  sources.settings.push_back(key + "=false");
  return loadScenario(sources);
}

void printHeader(const Simulation& simulation) {
  std::printf(
      "{\"version\": \"%s\", \"compiler\": \"%s\", \"particles\": %zu, \"step_s\": %.9g, \"threads\": %d, "
      "\"lift_duration_s\": %.9g}\n",
      kVersion, kCompiler, simulation.particleCount(), simulation.timeStep(), simulation.scenario().solver.threads,
      simulation.scenario().procedure.lift_duration_s);
  std::fflush(stdout);
}

/// Runs on, and tells at once where the world has frozen: a frozen one is fast.
StepReport advance(Simulation& simulation, double duration_s) {
  const StepReport report = simulation.advance(duration_s);
  if (simulation.frozen()) throw std::runtime_error(statusRemedy(StatusFlag::kNonFinite));
  return report;
}

void timeStretch(Simulation& simulation, double at_s, double duration_s) {
  const double wait_s = at_s - simulation.snapshot().time_s;
  if (wait_s > 0.5 * simulation.timeStep()) advance(simulation, wait_s);

  const Snapshot start = simulation.snapshot();
  const std::vector<float> strain_before = simulation.particles().plastic_strain;
  const double processor_before = processorTime();
  const auto clock_before = std::chrono::steady_clock::now();
  const StepReport report = advance(simulation, duration_s);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - clock_before).count();
  const double processor_s = processorTime() - processor_before;

  const std::vector<float> strain_after = simulation.particles().plastic_strain;
  std::size_t yielded = 0;
  for (std::size_t i = 0; i < strain_after.size(); ++i) yielded += strain_after[i] > strain_before[i] ? 1 : 0;
  const double particles = static_cast<double>(simulation.particleCount());
  std::printf(
      "{\"stage\": \"%s\", \"time_s\": %.9g, \"simulated_s\": %.9g, \"steps\": %llu, \"wall_s\": %.9g, "
      "\"processor_s\": %.9g, \"yielded_ratio\": %.6g, \"peak_memory_bytes\": %.0f, \"state_hash\": \"%016llx\"}\n",
      stageName(start.stage), start.time_s, simulation.snapshot().time_s - start.time_s,
      static_cast<unsigned long long>(report.steps), wall_s, processor_s, static_cast<double>(yielded) / particles,
      peakMemory(), static_cast<unsigned long long>(simulation.stateHash()));
  std::fflush(stdout);
}

int runProgram(int argc, char** argv) {
  CLI::App app("Times stretches of one simulation; see the head of bench/step_bench.cpp.", "step_bench");
  ScenarioSources sources;
  bool all_active = false;
  app.add_option("scenario", sources.file, "Scenario YAML")->required()->type_name("SCENARIO");
  app.add_option("--overlay", sources.overlays, "YAML with changed keys")->allow_extra_args(false)->type_name("FILE");
  app.add_option("--set", sources.settings, "Change one key")->allow_extra_args(false)->type_name("SECTION.KEY=VALUE");
  app.add_flag("--all-active", all_active, "Compute every particle in every step");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  Simulation simulation(makeScenario(sources, all_active));
  printHeader(simulation);
  for (std::string line; std::getline(std::cin, line);) {
    std::istringstream words(line);
    double at_s, duration_s;
    if (!(words >> at_s >> duration_s) || !(duration_s > 0.0)) {
      throw ConfigError("standard input", line, "must be AT_S DURATION_S, two numbers, the second > 0");
    }
    timeStretch(simulation, at_s, duration_s);
  }
  return 0;
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  using namespace brash_ice_rig;
  // As in the programs that users run.
  letWaitingThreadsSleep(argv);
  try {
    return runProgram(argc, argv);
  } catch (const ConfigError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "step_bench: %s\n", error.what());
    return 1;
  }
}
