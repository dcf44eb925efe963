// Drives `brash_ice study` as a user does.

#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "../output/shell.h"
#include "study_directory.h"

namespace brash_ice_rig {
namespace {

int count(const std::string& text, const std::string& part) {
  int found = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

bool waitUntil(const std::function<bool()>& fulfilled) {
  for (int i = 0; i < 600; ++i) {
    if (fulfilled()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  return false;
}

class StudyProgramTest : public ::testing::Test {
 protected:
  static constexpr const char* kGrid = "seeds: [1, 2]\ngrid: {ice.cohesion_pa: [50, 200]}\n";
  // Hours of simulated time.
  static constexpr const char* kEndless =
      "settings: {procedure.lift_speed_mps: 0.0001, procedure.lift_duration_s: 3600, load_cell.rate_hz: 10}\n"
      "cases: [{name: a}, {name: b}, {name: c}]\n";

  Outcome shell(const std::string& command) const { return runShell("cd '" + directory_.path() + "' && " + command); }
  Outcome program(const std::string& arguments) const { return shell("'" BRASH_ICE_PROGRAM "' " + arguments); }
  std::string read(const std::string& name) const { return readFile(directory_.file(name)); }
  bool exists(const std::string& name) const { return std::filesystem::exists(directory_.file(name)); }

  /// Status of a run that wrote its summary; empty without one.
  std::string statusOf(const std::string& run) const {
    const std::string path = "out/runs/" + run + "/seed_1/summary.json";
    return exists(path) ? YAML::Load(read(path))["status"].as<std::string>() : "";
  }
  /// Rows reach the disk once per simulated second; the header alone is shorter than this.
  bool isUnderWay(const std::string& run) const {
    std::error_code not_there_yet;
    const auto size =
        std::filesystem::file_size(directory_.file("out/runs/" + run + "/seed_1/force.csv"), not_there_yet);
    return !not_there_yet && size > 1000;
  }

  /// Starts the endless study and waits until two runs are at work.
  pid_t startEndless() const {
    directory_.putStudy(kEndless);
    std::string program = BRASH_ICE_PROGRAM, command = "study", out = "--out", jobs = "--jobs=2",
                report = "--no-report";
    std::string study = directory_.file("study.yaml"), directory = directory_.file("out");
    char* arguments[] = {program.data(),   command.data(), study.data(),  out.data(),
                         directory.data(), jobs.data(),    report.data(), nullptr};
    // It would start itself anew, under the same process id.
    setenv("OMP_WAIT_POLICY", "passive", 1);
    pid_t pid = 0;
    EXPECT_EQ(posix_spawn(&pid, program.c_str(), nullptr, nullptr, arguments, environ), 0);
    EXPECT_TRUE(waitUntil([this] { return isUnderWay("a") && isUnderWay("b"); }));
    return pid;
  }

  StudyDirectory directory_;
};

TEST_F(StudyProgramTest, LeavesTheFilesOfTheContract) {
  directory_.putStudy(kGrid);
  const Outcome outcome = program("study study.yaml --out out --jobs 2 --no-report");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_TRUE(contains(outcome.text, "4/4  cohesion_pa=")) << outcome.text;
  EXPECT_TRUE(contains(outcome.text, directory_.file("out/results.csv"))) << outcome.text;
  EXPECT_EQ(YAML::Load(read("out/study.yaml"))["cases"].size(), 2u);
  for (const char* name : {"scenario.yaml", "force.csv", "plug.csv", "summary.json", "log.txt", "program.txt"}) {
    EXPECT_TRUE(exists("out/runs/cohesion_pa=200/seed_2/" + std::string(name))) << name;
  }
  const std::string csv = read("out/results.csv");
  EXPECT_EQ(csv.rfind("case,seed,status,ice.cohesion_pa,peak_force_n,", 0), 0u) << csv;
  EXPECT_EQ(count(csv, "\n"), 5) << csv;
  EXPECT_EQ(count(csv, ",ok,"), 4) << csv;
  for (const char* wall_time : {"wall_s", "real_time_factor", "ns_per_particle_step"})
    EXPECT_FALSE(contains(csv, wall_time));

  // A run by hand gives the same.
  const Outcome by_hand = program("run small.yaml --set ice.cohesion_pa=50 --set field.seed=2 --out hand");
  ASSERT_EQ(by_hand.exit_code, 0) << by_hand.text;
  EXPECT_EQ(read("hand/force.csv"), read("out/runs/cohesion_pa=50/seed_2/force.csv"));
  EXPECT_EQ(read("hand/plug.csv"), read("out/runs/cohesion_pa=50/seed_2/plug.csv"));
}

TEST_F(StudyProgramTest, ResumedStudyMakesOnlyWhatIsMissingAndEndsWithTheSameTable) {
  directory_.putStudy(kGrid);
  ASSERT_EQ(program("study study.yaml --out out --no-report").exit_code, 0);
  const std::string csv = read("out/results.csv");
  std::filesystem::remove(directory_.file("out/runs/cohesion_pa=50/seed_1/summary.json"));
  const Outcome resumed = program("study study.yaml --out out --no-report --jobs 1");
  EXPECT_EQ(resumed.exit_code, 0);
  EXPECT_TRUE(contains(resumed.text, "4 runs, 3 of them made before")) << resumed.text;
  EXPECT_TRUE(contains(resumed.text, "1 is made again: it did not get to its end")) << resumed.text;
  EXPECT_EQ(read("out/results.csv"), csv);

  directory_.putStudy("settings: {water.density_kgpm3: 1010}\n" + std::string(kGrid));
  const Outcome changed = program("study study.yaml --out out --no-report");
  EXPECT_TRUE(contains(changed.text, "4 are made again: the scenario has changed")) << changed.text;
  EXPECT_NE(read("out/results.csv"), csv);
}

TEST_F(StudyProgramTest, AFailedRunEndsTheStudyWithOneAndIsNamed) {
  directory_.putStudy("cases: [{name: good}, {name: bad}]\n");
  // The run cannot write its force.csv.
  std::filesystem::create_directories(directory_.file("out/runs/bad/seed_1"));
  std::filesystem::create_symlink("/dev/full", directory_.file("out/runs/bad/seed_1/force.csv"));
  const Outcome outcome = program("study study.yaml --out out --no-report");
  EXPECT_EQ(outcome.exit_code, 1) << outcome.text;
  EXPECT_TRUE(contains(outcome.text, "out/runs/bad/seed_1: exit code 1, last line of its log: run failed: "))
      << outcome.text;
  const std::string csv = read("out/results.csv");
  EXPECT_TRUE(contains(csv, "good,1,ok,")) << csv;
  EXPECT_TRUE(contains(csv, "bad,1,\"failed: exit code 1")) << csv;
  EXPECT_TRUE(contains(csv, "No space left on device")) << csv;
}

TEST_F(StudyProgramTest, FrozenWorldFailsOnceAndIsRepeatedOnlyWhenAsked) {
  // The contact is far too stiff for the time step.
  directory_.putStudy("settings: {contact.min_stiffness_npm: 1.0e+11}\ncases: [{name: a}]\n");
  const Outcome first = program("study study.yaml --out out --no-report");
  EXPECT_EQ(first.exit_code, 1);
  EXPECT_TRUE(contains(first.text, "non_finite: ")) << first.text;
  EXPECT_TRUE(contains(read("out/results.csv"), "\"failed: ")) << read("out/results.csv");
  const Outcome second = program("study study.yaml --out out --no-report");
  EXPECT_EQ(second.exit_code, 1);
  EXPECT_TRUE(contains(second.text, "1 runs, 1 of them made before")) << second.text;
  EXPECT_TRUE(contains(second.text, "failed before (--repeat-failed")) << second.text;
  const Outcome third = program("study study.yaml --out out --no-report --repeat-failed");
  EXPECT_TRUE(contains(third.text, "1 is made again: it failed")) << third.text;
}

TEST_F(StudyProgramTest, BadStudyIsBadInputAndTouchesNothing) {
  directory_.putStudy("cases: [{name: a, settings: {ice.void_fraction: 2}}]\n");
  EXPECT_EQ(program("study study.yaml --out out").exit_code, 2);
  EXPECT_FALSE(exists("out"));
  EXPECT_EQ(program("study missing.yaml --out out").exit_code, 2);
  EXPECT_EQ(program("study").exit_code, 2);
  directory_.putStudy("cases: [{name: a}]\n");
  EXPECT_EQ(program("study study.yaml --jobs 0").exit_code, 2);
  EXPECT_EQ(program("study study.yaml --jobs many").exit_code, 2);
}

TEST_F(StudyProgramTest, CheckTakesStudies) {
  directory_.putStudy(kGrid);
  directory_.putStudy("cases: [{name: a, settings: {ice.void_fraction: 2}}]\n", "bad.yaml");
  const Outcome outcome = program("check study.yaml small.yaml bad.yaml");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(contains(outcome.text, "study.yaml: ok\n")) << outcome.text;
  EXPECT_TRUE(contains(outcome.text, "bad.yaml:3: case a: ice.void_fraction = 2")) << outcome.text;
}

TEST_F(StudyProgramTest, WithoutTheReportProgramTheTableStands) {
  // A copy: a link would lead to the program's own directory, where the report program may lie.
  std::filesystem::create_directory(directory_.file("bin"));
  std::filesystem::copy_file(BRASH_ICE_PROGRAM, directory_.file("bin/brash_ice"));
  directory_.putStudy("cases: [{name: a}]\n");
  const Outcome without = shell("bin/brash_ice study study.yaml --out out");
  EXPECT_EQ(without.exit_code, 0) << without.text;
  EXPECT_TRUE(contains(without.text, "no report: ")) << without.text;
  EXPECT_TRUE(exists("out/results.csv"));

  const std::string report =
      directory_.put("bin/study_report", "#!/bin/sh\ncat \"$1/results.csv\" > \"$1/report.html\"\n");
  std::filesystem::permissions(report, std::filesystem::perms::owner_all);
  const Outcome with = shell("bin/brash_ice study study.yaml --out out");
  EXPECT_EQ(with.exit_code, 0) << with.text;
  EXPECT_EQ(read("out/report.html"), read("out/results.csv"));
  EXPECT_FALSE(contains(with.text, "no report")) << with.text;
  // What is left of an older study does not stay beside a new one.
  EXPECT_EQ(shell("bin/brash_ice study study.yaml --out out --no-report").exit_code, 0);
  EXPECT_FALSE(exists("out/report.html"));

  directory_.put("bin/study_report", "#!/bin/sh\nexit 3\n");
  const Outcome failing = shell("bin/brash_ice study study.yaml --out out");
  EXPECT_EQ(failing.exit_code, 0) << failing.text;
  EXPECT_TRUE(contains(failing.text, "exit code 3")) << failing.text;
}

TEST_F(StudyProgramTest, TerminationEndsTheRunsCleanlyAndTheSameCommandGoesOn) {
  const pid_t pid = startEndless();
  // The directory is taken.
  const Outcome second = program("study study.yaml --out out --no-report");
  EXPECT_EQ(second.exit_code, 1);
  EXPECT_TRUE(contains(second.text, "another program is at work there")) << second.text;

  ASSERT_EQ(kill(pid, SIGTERM), 0);
  int status = 0;
  ASSERT_EQ(waitpid(pid, &status, 0), pid);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_EQ(statusOf("a"), "interrupted");
  EXPECT_EQ(statusOf("b"), "interrupted");
  EXPECT_FALSE(exists("out/runs/c"));
  EXPECT_FALSE(exists("out/results.csv"));

  directory_.putStudy("cases: [{name: a}, {name: b}, {name: c}]\n");
  const Outcome resumed = program("study study.yaml --out out --no-report");
  EXPECT_EQ(resumed.exit_code, 0) << resumed.text;
  EXPECT_EQ(statusOf("a"), "ok");
}

TEST_F(StudyProgramTest, RunsDoNotOutliveAStudyThatIsKilled) {
  const pid_t pid = startEndless();
  ASSERT_EQ(kill(pid, SIGKILL), 0);
  ASSERT_EQ(waitpid(pid, nullptr, 0), pid);
  EXPECT_TRUE(waitUntil([this] { return statusOf("a") == "interrupted" && statusOf("b") == "interrupted"; }));
}

TEST_F(StudyProgramTest, ProcessesUnderMpirunGiveTheSameTableBitForBit) {
  if (runShell("command -v mpirun").exit_code != 0) GTEST_SKIP() << "mpirun is not installed (package openmpi-bin)";
  directory_.putStudy(std::string(kGrid) + "figures: [{kind: force}]\n");
  ASSERT_EQ(program("study study.yaml --out alone --no-report").exit_code, 0);
  // CI runs as root, on fewer cores than processes.
  const std::string mpirun = "mpirun --allow-run-as-root --oversubscribe -n 2 '" BRASH_ICE_PROGRAM "' ";
  const Outcome spread = shell(mpirun + "study study.yaml --out spread --no-report");
  ASSERT_EQ(spread.exit_code, 0) << spread.text;
  EXPECT_EQ(count(spread.text, "4 runs, "), 1) << "only the first process announces\n" << spread.text;
  EXPECT_EQ(count(spread.text, " done in "), 4) << "each run is made once\n" << spread.text;
  EXPECT_EQ(count(spread.text, "results.csv"), 1) << "one process writes the table\n" << spread.text;
  EXPECT_EQ(read("spread/results.csv"), read("alone/results.csv"));
  EXPECT_EQ(read("spread/study.yaml"), read("alone/study.yaml"));
  // So it goes on from what was made by one process, and where there is nothing left to do.
  const Outcome resumed = shell(mpirun + "study study.yaml --out alone --no-report");
  EXPECT_EQ(resumed.exit_code, 0) << resumed.text;
  EXPECT_EQ(read("spread/results.csv"), read("alone/results.csv"));
  EXPECT_EQ(count(resumed.text, " done in "), 0) << resumed.text;
  // Bad input ends all processes, with the same exit code.
  EXPECT_EQ(shell(mpirun + "study missing.yaml --out none --no-report").exit_code, 2);
}

TEST_F(StudyProgramTest, OnlyTheSameCommandMayShareAndOnlyWhereItIsSaid) {
  directory_.putStudy(
      "cases: [{name: a, settings: {procedure.lift_speed_mps: 0.0001, procedure.lift_duration_s: 3600, "
      "load_cell.rate_hz: 10}}]\n");
  const std::string share = " --out out --no-report --share --jobs 1";
  ASSERT_EQ(
      shell("{ '" BRASH_ICE_PROGRAM "' study study.yaml" + share + " > first.txt 2>&1 & echo $! > pid; }").exit_code,
      0);
  ASSERT_TRUE(waitUntil([this] { return isUnderWay("a"); }));
  const Outcome alone = program("study study.yaml --out out --no-report");
  EXPECT_EQ(alone.exit_code, 1);
  EXPECT_TRUE(contains(alone.text, "another program is at work there")) << alone.text;
  directory_.putStudy("cases: [{name: a}]\n", "other.yaml");
  const Outcome other = program("study other.yaml" + share);
  EXPECT_EQ(other.exit_code, 1);
  EXPECT_TRUE(contains(other.text, "on something else or without --share")) << other.text;
  ASSERT_EQ(shell("kill $(cat pid)").exit_code, 0);
  EXPECT_TRUE(waitUntil([this] { return contains(read("first.txt"), "interrupted: 0 of 1 runs"); }));
  for (const char* lease : {"2", "4000", "long"}) {
    EXPECT_EQ(program("study other.yaml --out out --share --lease " + std::string(lease)).exit_code, 2) << lease;
  }
}

}  // namespace
}  // namespace brash_ice_rig
