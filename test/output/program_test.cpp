// Drives the program brash_ice as a user's script does.

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "shell.h"
#include "temporary_directory.h"

namespace brash_ice_rig {
namespace {

class ProgramTest : public ::testing::Test {
 protected:
  static constexpr const char* kSmallScenario =
      "title: Small field\n"
      "field: {length_x_m: 3.0, length_y_m: 3.0, thickness_m: 0.6}\n"
      "collector: {radius_m: 0.6}\n"
      "procedure: {settle_duration_s: 0.5, lift_duration_s: 1.5, hold_duration_s: 0.5}\n"
      "solver: {threads: 1}\n";

  Outcome program(const std::string& arguments) const {
    return runShell("cd '" + directory_.path() + "' && '" BRASH_ICE_PROGRAM "' " + arguments);
  }
  YAML::Node summaryIn(const std::string& run) const { return YAML::LoadFile(directory_.file(run + "/summary.json")); }

  TemporaryDirectory directory_;
  std::string scenario_ = directory_.put("small.yaml", kSmallScenario);
};

TEST_F(ProgramTest, VersionIsPrinted) {
  const Outcome outcome = program("--version");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.text.rfind("brash_ice ", 0), 0u) << outcome.text;
}

TEST_F(ProgramTest, WrongCommandLineIsBadInput) {
  EXPECT_EQ(program("").exit_code, 2);
  EXPECT_EQ(program("fly").exit_code, 2);
  EXPECT_EQ(program("run").exit_code, 2);
  EXPECT_EQ(program("run small.yaml --no-such-option").exit_code, 2);
  EXPECT_EQ(program("check").exit_code, 2);
  EXPECT_EQ(program("--help").exit_code, 0);
}

TEST_F(ProgramTest, UnknownKeyNamesTheNearestOneAndLeavesNothingBehind) {
  const Outcome outcome = program("run small.yaml --set field.spaceing_m=0.3 --out run");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(contains(outcome.text, "field.spacing_m")) << outcome.text;
  EXPECT_FALSE(std::filesystem::exists(directory_.file("run")));
}

TEST_F(ProgramTest, ValueOutOfRangeNamesKeyAndValue) {
  const Outcome outcome = program("run small.yaml --set ice.void_fraction=1.2 --out run");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(contains(outcome.text, "ice.void_fraction = 1.2")) << outcome.text;
}

TEST_F(ProgramTest, ThreadsAndVtkAreCheckedLikeTheirKeys) {
  const Outcome threads = program("run small.yaml --threads 0");
  EXPECT_EQ(threads.exit_code, 2);
  EXPECT_TRUE(contains(threads.text, "solver.threads")) << threads.text;
  const Outcome vtk = program("run small.yaml --vtk often");
  EXPECT_EQ(vtk.exit_code, 2);
  EXPECT_TRUE(contains(vtk.text, "output.vtk_interval_s")) << vtk.text;
}

TEST_F(ProgramTest, MissingFileIsBadInput) {
  const Outcome outcome = program("run nowhere.yaml");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(contains(outcome.text, "nowhere.yaml")) << outcome.text;
}

TEST_F(ProgramTest, ManualControlHasNoEndAndIsRefused) {
  const Outcome outcome = program("run small.yaml --set procedure.control=manual");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(contains(outcome.text, "procedure.control = manual")) << outcome.text;
}

TEST_F(ProgramTest, UnwritableDirectoryFailsTheRun) {
  const Outcome outcome = program("run small.yaml --out small.yaml/run");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_TRUE(contains(outcome.text, "small.yaml/run: Not a directory")) << outcome.text;
}

TEST_F(ProgramTest, ClosedStreamsLeaveTheFilesAlone) {
  EXPECT_EQ(program("run small.yaml --out open").exit_code, 0);
  EXPECT_EQ(program("run small.yaml --out shut <&- >&- 2>&-;").exit_code, 0);
  const auto read = [this](const std::string& name) {
    std::ifstream in(directory_.file(name));
    return std::string(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  };
  EXPECT_EQ(read("shut/force.csv"), read("open/force.csv"));
}

TEST_F(ProgramTest, FullDiskFailsTheRunAndLeavesNoSummary) {
  std::filesystem::create_directory(directory_.file("run"));
  std::filesystem::create_symlink("/dev/full", directory_.file("run/force.csv"));
  const Outcome outcome = program("run small.yaml --out run");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_TRUE(contains(outcome.text, "run/force.csv: No space left on device")) << outcome.text;
  EXPECT_FALSE(std::filesystem::exists(directory_.file("run/summary.json")));
}

TEST_F(ProgramTest, CheckSaysOkPerFileAndTakesOverlays) {
  directory_.put("overlay.yaml", "ice: {cohesion_pa: 100.0}\n");
  const Outcome outcome = program("check small.yaml overlay.yaml");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.text, "small.yaml: ok\noverlay.yaml: ok\n");
}

TEST_F(ProgramTest, CheckReportsEachBadFileAndGoesOn) {
  directory_.put("unknown.yaml", "field: {spaceing_m: 0.3}\n");
  directory_.put("broken.yaml", "field: {spacing_m: [0.3\n");
  directory_.put("empty.yaml", "");
  const Outcome outcome = program("check unknown.yaml broken.yaml empty.yaml missing.yaml small.yaml");
  EXPECT_EQ(outcome.exit_code, 2);
  for (const char* name : {"unknown.yaml", "broken.yaml", "empty.yaml", "missing.yaml"}) {
    EXPECT_TRUE(contains(outcome.text, name)) << outcome.text;
    EXPECT_FALSE(contains(outcome.text, std::string(name) + ": ok")) << outcome.text;
  }
  EXPECT_TRUE(contains(outcome.text, "small.yaml: ok")) << outcome.text;
}

TEST_F(ProgramTest, SmallRunLeavesItsFiles) {
  const Outcome outcome = program("run small.yaml --out run --vtk 0.75");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  for (const char* name :
       {"run/force.csv", "run/plug.csv", "run/scenario.yaml", "run/summary.json", "run/vtk/run.pvd"}) {
    EXPECT_TRUE(contains(outcome.text, name)) << "path not printed: " << name;
    EXPECT_TRUE(std::filesystem::exists(directory_.file(name))) << name;
  }
  for (const char* stage : {"settle", "lift", "hold"}) EXPECT_TRUE(contains(outcome.text, stage)) << outcome.text;

  const YAML::Node summary = summaryIn("run");
  EXPECT_EQ(summary["status"].as<std::string>(), "ok");
  EXPECT_NEAR(summary["simulated_s"].as<double>(), 2.5, 0.011);
  EXPECT_GT(summary["real_time_factor"].as<double>(), 0.0);
  EXPECT_GT(summary["ns_per_particle_step"].as<double>(), 0.0);

  // 2.5 s at 100 Hz; the last sample may or may not belong to the stage that ends the run.
  std::ifstream csv(directory_.file("run/force.csv"));
  int lines = 0;
  for (std::string line; std::getline(csv, line);) ++lines;
  EXPECT_NEAR(lines - 1, 250, 1);

  // At the start, -0.5 s, and then at multiples of the interval: 0, 0.75 and 1.5 s.
  EXPECT_TRUE(std::filesystem::exists(directory_.file("run/vtk/ice_000003.vtp")));
  EXPECT_FALSE(std::filesystem::exists(directory_.file("run/vtk/ice_000004.vtp")));
  EXPECT_TRUE(contains(readFile(directory_.file("run/vtk/run.pvd")), "timestep=\"0.75\""));
  EXPECT_EQ(program("check run/scenario.yaml").exit_code, 0);
}

TEST_F(ProgramTest, EffectiveScenarioRepeatsTheRunBitForBit) {
  ASSERT_EQ(program("run small.yaml --out first --set ice.cohesion_pa=150").exit_code, 0);
  ASSERT_EQ(program("run first/scenario.yaml --out again").exit_code, 0);
  ASSERT_EQ(program("run first/scenario.yaml --out two_threads --threads 2").exit_code, 0);
  ASSERT_EQ(program("run small.yaml --out other").exit_code, 0);
  const auto hash = summaryIn("first")["state_hash"].as<std::string>();
  EXPECT_EQ(summaryIn("again")["state_hash"].as<std::string>(), hash);
  EXPECT_EQ(summaryIn("two_threads")["state_hash"].as<std::string>(), hash);
  EXPECT_NE(summaryIn("other")["state_hash"].as<std::string>(), hash) << "the hash does not see the cohesion";
  EXPECT_EQ(readFile(directory_.file("again/force.csv")), readFile(directory_.file("two_threads/force.csv")));
  EXPECT_EQ(summaryIn("two_threads")["threads"].as<int>(), 2);
}

TEST_F(ProgramTest, OverlaysAndSettingsMayBeRepeatedAndTheLastSettingWins) {
  directory_.put("a.yaml", "ice: {cohesion_pa: 111.0}\n");
  directory_.put("b.yaml", "water: {density_kgpm3: 1025.0}\n");
  const Outcome outcome = program(
      "run --overlay a.yaml --overlay b.yaml --set field.seed=5 --set field.seed=6 small.yaml --out run"
      " --set procedure.lift_duration_s=0.1");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  const YAML::Node scenario = YAML::LoadFile(directory_.file("run/scenario.yaml"));
  EXPECT_EQ(scenario["ice"]["cohesion_pa"].as<double>(), 111.0);
  EXPECT_EQ(scenario["water"]["density_kgpm3"].as<double>(), 1025.0);
  EXPECT_EQ(scenario["field"]["seed"].as<int>(), 6);
}

TEST_F(ProgramTest, InterruptEndsTheRunCleanly) {
  const std::string run = directory_.file("run");
  std::string program = BRASH_ICE_PROGRAM;
  std::string command = "run", out = "--out", set = "--set", duration = "procedure.lift_duration_s=3600",
              speed = "procedure.lift_speed_mps=0.001", directory = run, scenario = scenario_;
  char* arguments[] = {program.data(), command.data(),  scenario.data(), out.data(),   directory.data(),
                       set.data(),     duration.data(), set.data(),      speed.data(), nullptr};
  pid_t pid = 0;
  ASSERT_EQ(posix_spawn(&pid, program.c_str(), nullptr, nullptr, arguments, environ), 0);
  // Rows reach the disk once per simulated second; the header alone is shorter than this.
  for (int i = 0; i < 600; ++i) {
    std::error_code not_there_yet;
    if (std::filesystem::file_size(run + "/force.csv", not_there_yet) > 1000 && !not_there_yet) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  ASSERT_EQ(kill(pid, SIGINT), 0);
  int status = 0;
  ASSERT_EQ(waitpid(pid, &status, 0), pid);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_EQ(summaryIn("run")["status"].as<std::string>(), "interrupted");
  EXPECT_EQ(readFile(run + "/force.csv").back(), '\n');
}

TEST_F(ProgramTest, RunStopsWithItsStandardInputWhenAsked) {
  const std::string endless =
      "run small.yaml --set procedure.lift_duration_s=3600 --set procedure.lift_speed_mps=0.001 ";
  // `true` closes the pipe at once.
  const Outcome outcome = runShell("cd '" + directory_.path() + "' && true | '" BRASH_ICE_PROGRAM "' " + endless +
                                   "--stop-when-stdin-closes --out run");
  EXPECT_EQ(outcome.exit_code, 1) << outcome.text;
  EXPECT_EQ(summaryIn("run")["status"].as<std::string>(), "interrupted");
  // Not asked, or nothing that can be closed: the run goes to its end.
  const auto status = [&](const std::string& arguments) {
    runShell("cd '" + directory_.path() + "' && " + arguments);
    return summaryIn("run")["status"].as<std::string>();
  };
  const std::string program = "'" BRASH_ICE_PROGRAM "' run small.yaml --out run ";
  EXPECT_EQ(status("true | " + program), "ok");
  EXPECT_EQ(status(program + "--stop-when-stdin-closes </dev/null"), "ok");
}

// ---- checkpoints

class ResumeTest : public ProgramTest {
 protected:
  static constexpr const char* kOptions =
      " --set load_cell.noise_n=15 --set output.energy=true --checkpoint-every 0.2 ";

  /// Starts a run and kills it once it has left a checkpoint, as a power cut would.
  void runAndKill(const std::string& out) {
    pid_t pid = fork();
    if (pid == 0) {
      if (chdir(directory_.path().c_str()) != 0) _exit(127);
      const int null = open("/dev/null", O_WRONLY);
      dup2(null, STDOUT_FILENO);
      dup2(null, STDERR_FILENO);
      execl(BRASH_ICE_PROGRAM, BRASH_ICE_PROGRAM, "run", "small.yaml", "--out", out.c_str(), "--set",
            "load_cell.noise_n=15", "--set", "output.energy=true", "--checkpoint-every", "0.05", nullptr);
      _exit(127);
    }
    ASSERT_GT(pid, 0);
    for (int k = 0; k < 6000 && !std::filesystem::exists(directory_.file(out + "/checkpoint.bin")); ++k) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(40));
    ASSERT_EQ(kill(pid, SIGKILL), 0);
    int status = 0;
    ASSERT_EQ(waitpid(pid, &status, 0), pid);
    ASSERT_TRUE(WIFSIGNALED(status)) << "it had ended already: the test proves nothing";
  }

  void expectSameFiles(const std::string& resumed, const std::string& whole) {
    for (const char* name : {"/force.csv", "/plug.csv", "/energy.csv", "/scenario.yaml"}) {
      EXPECT_EQ(readFile(directory_.file(resumed + name)), readFile(directory_.file(whole + name))) << name;
    }
    const YAML::Node a = summaryIn(resumed), b = summaryIn(whole);
    for (const auto& entry : b) {
      const auto key = entry.first.as<std::string>();
      if (key == "wall_s" || key == "real_time_factor" || key == "ns_per_particle_step" || key == "threads") continue;
      EXPECT_EQ(a[key].as<std::string>(), entry.second.as<std::string>()) << key;
    }
  }
};

TEST_F(ResumeTest, AfterKillMinus9TheFilesAreThoseOfTheUninterruptedRun) {
  ASSERT_EQ(program(std::string("run small.yaml --out whole") + kOptions).exit_code, 0);
  runAndKill("killed");
  EXPECT_FALSE(std::filesystem::exists(directory_.file("killed/summary.json")));
  // Where it lies, and, from the same checkpoint, elsewhere and with other threads.
  std::filesystem::copy(directory_.file("killed/checkpoint.bin"), directory_.file("moved.bin"));
  Outcome outcome = program("run --resume killed/checkpoint.bin");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  expectSameFiles("killed", "whole");
  outcome = program("run --resume moved.bin --out elsewhere --threads 2");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_EQ(summaryIn("elsewhere")["threads"].as<int>(), 2);
  EXPECT_EQ(readFile(directory_.file("elsewhere/force.csv")), readFile(directory_.file("whole/force.csv")));
}

TEST_F(ResumeTest, OfAnInterruptedRunLosesNothing) {
  ASSERT_EQ(program(std::string("run small.yaml --out whole") + kOptions).exit_code, 0);
  // `true` closes the pipe at once: stopped after the first sample.
  runShell("cd '" + directory_.path() + "' && true | '" BRASH_ICE_PROGRAM "' run small.yaml --out run" + kOptions +
           "--stop-when-stdin-closes");
  EXPECT_EQ(summaryIn("run")["status"].as<std::string>(), "interrupted");
  ASSERT_EQ(program("run --resume run/checkpoint.bin --checkpoint-every 0.2").exit_code, 0);
  expectSameFiles("run", "whole");
  // And of one that was done: the files stay what they are.
  ASSERT_EQ(program("run --resume run/checkpoint.bin").exit_code, 0);
  expectSameFiles("run", "whole");
}

TEST_F(ResumeTest, GoesOnWithTheSeriesOfPictures) {
  ASSERT_EQ(program(std::string("run small.yaml --vtk 0.5 --out whole") + kOptions).exit_code, 0);
  ASSERT_EQ(program("run --resume whole/checkpoint.bin --out elsewhere").exit_code, 0);
  const std::string before = readFile(directory_.file("whole/vtk/run.pvd"));
  ASSERT_EQ(program("run --resume whole/checkpoint.bin").exit_code, 0);
  EXPECT_EQ(readFile(directory_.file("whole/vtk/run.pvd")), before);
  EXPECT_FALSE(std::filesystem::exists(directory_.file("elsewhere/vtk/ice_000000.vtp")))
      << "a picture of the end under the number of the start";
}

TEST_F(ResumeTest, BadCheckpointsAreBadInputAndNothingIsTouched) {
  ASSERT_EQ(program(std::string("run small.yaml --out run") + kOptions).exit_code, 0);
  const std::string good = readFile(directory_.file("run/checkpoint.bin"));
  const std::string force = readFile(directory_.file("run/force.csv"));
  const auto refusal = [&](const std::string& content) {
    directory_.put("run/checkpoint.bin", content);
    const Outcome outcome = program("run --resume run/checkpoint.bin");
    EXPECT_EQ(outcome.exit_code, 2) << outcome.text;
    EXPECT_EQ(readFile(directory_.file("run/force.csv")), force);
    EXPECT_TRUE(std::filesystem::exists(directory_.file("run/summary.json")));
    return outcome.text;
  };
  std::string flipped = good;
  flipped[flipped.size() / 2] = static_cast<char>(flipped[flipped.size() / 2] ^ 4);
  EXPECT_EQ(refusal(flipped), "run/checkpoint.bin: is damaged: its checksum is wrong\n");
  EXPECT_EQ(program("check run/checkpoint.bin").exit_code, 2);
  EXPECT_TRUE(contains(refusal(good.substr(0, good.size() / 2)), "run/checkpoint.bin: is damaged: it has"));
  EXPECT_TRUE(contains(refusal("field: {}\n"), "run/checkpoint.bin: is not a checkpoint of brash_ice_rig"));
  directory_.put("run/checkpoint.bin", good);
  EXPECT_TRUE(contains(program("check run/checkpoint.bin").text, "run/checkpoint.bin: ok, a checkpoint at"));
  EXPECT_EQ(program("run --resume nowhere.bin").exit_code, 2);
}

TEST_F(ResumeTest, OptionsThatCannotGoTogetherAreRefused) {
  EXPECT_EQ(program("run").exit_code, 2);
  EXPECT_EQ(program("run small.yaml --resume x.bin").exit_code, 2);
  EXPECT_EQ(program("run --resume x.bin --set ice.cohesion_pa=1").exit_code, 2);
  EXPECT_EQ(program("run --resume x.bin --overlay small.yaml").exit_code, 2);
  EXPECT_EQ(program("run --resume x.bin --vtk 1").exit_code, 2);
  for (const char* interval : {"0", "-1", "nan", "1e9", "often"}) {
    const Outcome outcome = program(std::string("run small.yaml --checkpoint-every ") + interval);
    EXPECT_EQ(outcome.exit_code, 2) << interval;
    EXPECT_TRUE(contains(outcome.text, std::string("--checkpoint-every = ") + interval + ", must ")) << outcome.text;
  }
  const Outcome threads = program("run --resume x.bin --threads 0");
  EXPECT_EQ(threads.exit_code, 2);
  EXPECT_TRUE(contains(threads.text, "solver.threads = 0")) << threads.text;
}

// Each kill hits the program at another moment, and many hit it while it writes: it does so every 10 ms of the test.
TEST_F(ResumeTest, KillsWhileItSavesNeverLeaveADamagedCheckpoint) {
  int seen = 0;
  for (int k = 0; k < 16; ++k) {
    pid_t pid = fork();
    if (pid == 0) {
      if (chdir(directory_.path().c_str()) != 0) _exit(127);
      const int null = open("/dev/null", O_WRONLY);
      dup2(null, STDOUT_FILENO);
      dup2(null, STDERR_FILENO);
      execl(BRASH_ICE_PROGRAM, BRASH_ICE_PROGRAM, "run", "small.yaml", "--out", "run", "--checkpoint-every", "0.01",
            nullptr);
      _exit(127);
    }
    ASSERT_GT(pid, 0);
    std::this_thread::sleep_for(std::chrono::milliseconds(60 + 11 * k));
    kill(pid, SIGKILL);
    waitpid(pid, nullptr, 0);
    if (!std::filesystem::exists(directory_.file("run/checkpoint.bin"))) continue;
    ++seen;
    const Outcome outcome = program("check run/checkpoint.bin");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  }
  EXPECT_GT(seen, 5) << "too few got as far as a checkpoint";
}

}  // namespace
}  // namespace brash_ice_rig
