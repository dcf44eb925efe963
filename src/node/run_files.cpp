#include "brash_ice_rig/node/run_files.h"

#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <thread>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace brash_ice_rig {

RunFiles::RunFiles(const Simulation& simulation, const std::string& directory) : writer_(simulation, directory) {
  if (simulation.scenario().output.vtk_interval_s > 0.0) vtk_.emplace(directory + "/vtk");
}

void RunFiles::write(const Simulation& simulation, const Snapshot& snapshot, StatusFlags raised) {
  writer_.write(snapshot, raised);
  if (vtk_) vtk_->writeIfDue(simulation, snapshot);
}

void RunFiles::finish(const Simulation& simulation, double compute_s, bool interrupted) {
  RunTiming timing;
  timing.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  timing.compute_s = compute_s;
  const RunSummary summary = writer_.finish(simulation, timing, interrupted);
  std::printf("%s\n%s\n%s\n%s\n", describe(summary).c_str(), writer_.scenarioPath().c_str(),
              writer_.forcePath().c_str(), writer_.summaryPath().c_str());
  if (vtk_) std::printf("%s\n", vtk_->collectionPath().c_str());
  std::fflush(stdout);
}

void plotRun(const std::string& directory) {
  namespace fs = std::filesystem;
  constexpr std::chrono::seconds kTimeout{60};

  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error).parent_path() / "plot_force";
  std::string program_text = program.string(), force_csv = directory + "/force.csv";
  char* const arguments[] = {program_text.data(), force_csv.data(), nullptr};
  // In a process group of its own, so that a Ctrl-C for the node does not end the plot of what the node has left.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t child = 0;
  const int code = posix_spawn(&child, program_text.c_str(), nullptr, &attributes, arguments, environ);
  posix_spawnattr_destroy(&attributes);
  if (code != 0) {
    std::fprintf(stderr, "no force plot: %s: %s\n", program_text.c_str(), std::strerror(code));
    return;
  }
  int status = 0;
  pid_t done = 0;
  for (const auto start = std::chrono::steady_clock::now(); std::chrono::steady_clock::now() - start < kTimeout;) {
    done = waitpid(child, &status, WNOHANG);
    if (done != 0) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  if (done == 0) {
    kill(child, SIGKILL);
    waitpid(child, &status, 0);
  }
  if (done != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    std::fprintf(stderr, "no force plot: %s %s failed\n", program_text.c_str(), force_csv.c_str());
  }
}

}  // namespace brash_ice_rig
