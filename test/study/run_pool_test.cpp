// The pool and the resuming with programs that only pretend to simulate: shell scripts that leave what `brash_ice run`
// would leave, or fail as it might.

#include "brash_ice_rig/study/run_pool.h"

#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/study/claims.h"
#include "brash_ice_rig/study/results.h"
#include "brash_ice_rig/study/run_directory.h"
#include "study_directory.h"

namespace brash_ice_rig {
namespace {

/// $4 is the directory: the arguments are run SCENARIO --out DIRECTORY --stop-when-stdin-closes.
constexpr const char* kLeaveResults =
    "printf 'time_s\\n' > \"$4/force.csv\"; printf 'time_s,mass\\n0,1\\n0.5,2\\n' > \"$4/plug.csv\"\n"
    "printf '{\"peak_force_n\": 1, \"status\": \"%s\"}' \"${status:-ok}\" > \"$4/summary.json\"\n";

class RunPoolTest : public ::testing::Test {
 protected:
  std::string putProgram(const std::string& text, const std::string& name = "program") const {
    const std::string path = directory_.put(name, "#!/bin/sh\n" + text);
    chmod(path.c_str(), 0755);
    return path;
  }

  std::vector<RunJob> jobs(int count) const {
    std::vector<RunJob> jobs;
    for (int i = 0; i < count; ++i) jobs.push_back({directory_.file("run_" + std::to_string(i)), Scenario{}});
    return jobs;
  }

  std::vector<RunStatus> make(const std::vector<RunJob>& all, RunPoolOptions options) {
    std::vector<RunStatus> statuses = findEarlierRuns(all, options.program, false);
    makeRuns(all, options, statuses);
    return statuses;
  }

  RunPoolOptions optionsFor(const std::string& program) const {
    RunPoolOptions options;
    options.program = program;
    options.children = 2;
    return options;
  }

  /// State and note of a single run that is looked for again.
  RunStatus again(const Scenario& scenario, const std::string& program, bool repeat_failed = false) const {
    return findEarlierRuns({{directory_.file("run_0"), scenario}}, program, repeat_failed).front();
  }

  TemporaryDirectory directory_;
};

TEST_F(RunPoolTest, MakesEveryRunWithItsScenarioAndKeepsItsLog) {
  const std::string program =
      putProgram(std::string("echo hello; echo there >&2; echo \"$1 $2 $3 $5\"\n") + kLeaveResults);
  std::vector<RunJob> all = jobs(5);
  for (std::size_t i = 0; i < all.size(); ++i) all[i].scenario.ice.cohesion_pa = 100.0 + static_cast<double>(i);
  for (const RunStatus& status : make(all, optionsFor(program))) {
    EXPECT_EQ(status.state, RunState::kDone) << status.note;
    EXPECT_FALSE(status.earlier);
  }
  for (const RunJob& job : all) {
    EXPECT_EQ(readFile(job.directory + "/scenario.yaml"), toYaml(job.scenario));
    EXPECT_EQ(readFile(job.directory + "/log.txt"),
              "hello\nthere\nrun " + job.directory + "/scenario.yaml --out --stop-when-stdin-closes\n");
    EXPECT_EQ(readFile(job.directory + "/program.txt"), programStamp(program));
  }
}

TEST_F(RunPoolTest, RunsAsManyAtATimeAsItMay) {
  // Each run waits until three have begun, which takes three at a time, and notes how many are at work with it.
  const std::string begun = directory_.file("begun"), live = directory_.file("live");
  std::filesystem::create_directory(begun);
  std::filesystem::create_directory(live);
  const std::string program =
      putProgram("mkdir '" + begun + "'/$$ '" + live + "'/$$\ni=0\n" + "while [ $(ls '" + begun +
                 "' | wc -l) -lt 3 ]; do\n" + "sleep 0.1; i=$((i+1)); [ $i -lt 300 ] || exit 1\n" + "done\n" + "ls '" +
                 live + "' | wc -l; rmdir '" + live + "'/$$\n" + kLeaveResults);
  RunPoolOptions options = optionsFor(program);
  options.children = 3;
  const std::vector<RunJob> all = jobs(7);
  for (const RunStatus& status : make(all, options)) EXPECT_EQ(status.state, RunState::kDone) << "fewer than three";
  for (const RunJob& job : all) EXPECT_LE(std::stoi(readFile(job.directory + "/log.txt")), 3);
}

TEST_F(RunPoolTest, ARunThatFailsOrCrashesSaysWhyAndDoesNotStopTheOthers) {
  const std::string program = putProgram(std::string("case $4 in\n"
                                                     "*_0) echo first; echo 'disk is full'; echo; exit 1;;\n"
                                                     "*_1) echo at 3 s; kill -SEGV $$;;\n"
                                                     "*_2) exit 0;;\n"
                                                     "*_3) status='non_finite: remedy';;\n"
                                                     "esac\n") +
                                         kLeaveResults + "case $4 in *_3) exit 1;; esac\n");
  std::vector<RunJob> all = jobs(6);
  // Its directory cannot be made.
  all[4].directory = directory_.put("file", "") + "/run_4";
  const std::vector<RunStatus> statuses = make(all, optionsFor(program));
  for (int i = 0; i < 5; ++i) EXPECT_EQ(statuses[i].state, RunState::kFailed) << i;
  EXPECT_EQ(statuses[0].note, "exit code 1, last line of its log: disk is full");
  EXPECT_EQ(statuses[1].note, "ended by signal 11 (Segmentation fault), last line of its log: at 3 s");
  EXPECT_NE(statuses[2].note.find("summary.json: file cannot be read: No such file"), std::string::npos)
      << statuses[2].note;
  EXPECT_EQ(statuses[3].note, "non_finite: remedy");
  EXPECT_NE(statuses[4].note.find("Not a directory"), std::string::npos) << statuses[4].note;
  EXPECT_EQ(statuses[5].state, RunState::kDone) << statuses[5].note;
}

TEST_F(RunPoolTest, AProgramThatDoesNotStartFailsTheRun) {
  const std::string program = directory_.put("no_program", "text");
  const std::vector<RunStatus> statuses = make(jobs(1), optionsFor(program));
  EXPECT_EQ(statuses[0].state, RunState::kFailed);
  EXPECT_NE(statuses[0].note.find("no_program: Permission denied"), std::string::npos) << statuses[0].note;
}

TEST_F(RunPoolTest, StopEndsTheChildrenAndLeavesTheRestWaiting) {
  const std::string program = putProgram("echo started\nexec sleep 600\n");
  RunPoolOptions options = optionsFor(program);
  const std::vector<RunJob> all = jobs(3);
  options.stop = [&] {
    // As soon as both children are at work.
    return std::filesystem::exists(all[1].directory + "/log.txt") && !readFile(all[1].directory + "/log.txt").empty();
  };
  const auto start = std::chrono::steady_clock::now();
  for (const RunStatus& status : make(all, options)) EXPECT_EQ(status.state, RunState::kWaiting);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(60));
  EXPECT_FALSE(std::filesystem::exists(all[2].directory));
}

// ---- resuming

TEST_F(RunPoolTest, FinishedRunsAreNotMadeAgain) {
  const std::string program =
      putProgram(std::string("echo once >> '") + directory_.file("count") + "'\n" + kLeaveResults);
  make(jobs(2), optionsFor(program));
  std::filesystem::remove(directory_.file("run_1/summary.json"));
  const std::vector<RunStatus> second = make(jobs(3), optionsFor(program));
  EXPECT_EQ(readFile(directory_.file("count")), "once\nonce\nonce\nonce\n") << "2 at first, then 1 again and 1 new";
  EXPECT_TRUE(second[0].earlier);
  EXPECT_FALSE(second[1].earlier);
  for (const RunStatus& status : second) EXPECT_EQ(status.state, RunState::kDone);
}

TEST_F(RunPoolTest, WhatDoesNotCountIsMadeAgainAndSaysWhy) {
  const std::string program = putProgram(kLeaveResults);
  EXPECT_EQ(again(Scenario{}, program).state, RunState::kWaiting);
  EXPECT_EQ(again(Scenario{}, program).note, "") << "there is nothing yet";
  make(jobs(1), optionsFor(program));
  ASSERT_EQ(again(Scenario{}, program).state, RunState::kDone);

  Scenario other;
  other.ice.cohesion_pa = std::nextafter(200.0, 300.0);
  EXPECT_EQ(again(other, program).note, "the scenario has changed");
  EXPECT_EQ(again(Scenario{}, putProgram("exit 0\n", "newer")).note, "the program has changed");

  const std::string run = directory_.file("run_0");
  const auto put = [&](const char* name, const std::string& text) {
    return directory_.put(std::string("run_0/") + name, text);
  };
  put("summary.json", "{\"status\": \"interrupted\"}");
  EXPECT_EQ(again(Scenario{}, program).note, "it was interrupted");
  put("summary.json", "{\"status\": ");
  EXPECT_EQ(again(Scenario{}, program).note, "its summary.json is damaged");
  std::filesystem::remove(run + "/summary.json");
  EXPECT_EQ(again(Scenario{}, program).note, "it did not get to its end");
  put("summary.json", "{\"status\": \"ok\"}");
  EXPECT_EQ(again(Scenario{}, program).state, RunState::kDone);
  std::filesystem::remove(run + "/plug.csv");
  EXPECT_EQ(again(Scenario{}, program).note, "plug.csv is missing");
  put("plug.csv", "");
  put("scenario.yaml", "field: {length_x_m: no}\n");
  EXPECT_EQ(again(Scenario{}, program).note, "the scenario has changed");
}

TEST_F(RunPoolTest, ThreadsAndTheWayAScenarioIsWrittenDoNotCount) {
  const std::string program = putProgram(kLeaveResults);
  make(jobs(1), optionsFor(program));
  Scenario threads;
  threads.solver.threads = 7;
  EXPECT_EQ(again(threads, program).state, RunState::kDone);
  directory_.put("run_0/scenario.yaml", "# all defaults\nice: {cohesion_pa: 2.0e+2}\n");
  EXPECT_EQ(again(Scenario{}, program).state, RunState::kDone);
}

TEST_F(RunPoolTest, AFrozenWorldIsNotRepeatedUnlessAsked) {
  const std::string program =
      putProgram(std::string("status='fold_jammed: a; non_finite: b'\n") + kLeaveResults + "exit 1\n");
  make(jobs(1), optionsFor(program));
  EXPECT_EQ(again(Scenario{}, program).state, RunState::kFailed);
  EXPECT_EQ(again(Scenario{}, program).note, "fold_jammed: a; non_finite: b");
  EXPECT_TRUE(again(Scenario{}, program).earlier);
  EXPECT_EQ(again(Scenario{}, program, true).state, RunState::kWaiting);
  // Other warnings are none of failure.
  directory_.put("run_0/summary.json", "{\"status\": \"fold_jammed: looks non_finite: but is not\"}");
  EXPECT_EQ(again(Scenario{}, program).state, RunState::kDone);
}

// ---- sharing

/// Counts lines of a file that each run adds one to.
std::string counting(const TemporaryDirectory& directory) {
  return "echo once >> '" + directory.file("count") + "'\n";
}

TEST_F(RunPoolTest, ProcessesThatShareMakeEachRunOnceAndAllSeeTheEnd) {
  const std::string program = putProgram(counting(directory_) + "sleep 0.05\n" + kLeaveResults);
  RunPoolOptions options = optionsFor(program);
  options.shared = true;
  const std::vector<RunJob> all = jobs(12);
  std::vector<std::vector<RunStatus>> results(3);
  std::vector<std::thread> pools;
  for (auto& result : results) pools.emplace_back([&] { result = make(all, options); });
  for (std::thread& pool : pools) pool.join();
  const std::string count = readFile(directory_.file("count"));
  EXPECT_EQ(std::count(count.begin(), count.end(), '\n'), 12);
  for (std::size_t job = 0; job < all.size(); ++job) {
    int made = 0;
    for (const auto& result : results) {
      EXPECT_EQ(result[job].state, RunState::kDone);
      made += result[job].elsewhere || result[job].earlier ? 0 : 1;
    }
    EXPECT_EQ(made, 1);
    EXPECT_FALSE(Claims::isClaimed(all[job].directory));
  }
}

TEST_F(RunPoolTest, AFailureElsewhereCountsForThoseAtWorkAndIsTriedAgainLater) {
  const std::string program = putProgram(counting(directory_) + "sleep 0.2; echo no luck; exit 3\n");
  RunPoolOptions options = optionsFor(program);
  options.shared = true;
  const std::vector<RunJob> all = jobs(1);
  std::vector<std::vector<RunStatus>> results(2);
  std::vector<std::thread> pools;
  for (auto& result : results) pools.emplace_back([&] { result = make(all, options); });
  for (std::thread& pool : pools) pool.join();
  EXPECT_EQ(readFile(directory_.file("count")), "once\n");
  for (const auto& result : results) {
    EXPECT_EQ(result[0].state, RunState::kFailed);
    EXPECT_EQ(result[0].note, "exit code 3, last line of its log: no luck");
  }
  EXPECT_EQ(again(Scenario{}, program).state, RunState::kWaiting);
  EXPECT_EQ(make(all, options)[0].state, RunState::kFailed);
  EXPECT_EQ(readFile(directory_.file("count")), "once\nonce\n");
}

TEST_F(RunPoolTest, ARunWhoseProcessDiedIsMadeAgainEvenWithASummary) {
  const std::string program = putProgram(counting(directory_) + kLeaveResults);
  const std::vector<RunJob> all = jobs(1);
  make(all, optionsFor(program));
  // Of a kernel that has been shut down since; no sign of life will come.
  directory_.put("run_0/claim.1", "host,0,1,1 other_kernel 1 1 0000000.300 0000000001\n");
  EXPECT_EQ(again(Scenario{}, program).state, RunState::kWaiting);
  EXPECT_EQ(again(Scenario{}, program).note, "it did not get to its end");
  const std::vector<RunStatus> statuses = make(all, optionsFor(program));
  EXPECT_EQ(statuses[0].state, RunState::kDone);
  EXPECT_EQ(readFile(directory_.file("count")), "once\nonce\n");
  EXPECT_FALSE(Claims::isClaimed(all[0].directory));
}

TEST_F(RunPoolTest, WhoeverHasBeenTakenForDeadLeavesItsRunToTheNewOwner) {
  const std::string started = directory_.file("started");
  const std::string program =
      putProgram("if mkdir '" + started + "' 2>/dev/null; then exec sleep 600; fi\n" + kLeaveResults);
  RunPoolOptions options = optionsFor(program);
  options.lease_s = 0.6;
  const std::vector<RunJob> all = jobs(1);
  bool taken_over = false;
  options.tick = [&] {
    if (taken_over || !std::filesystem::exists(started)) return;
    taken_over = true;
    directory_.put("run_0/claim.2", "host,0,1,1 other_kernel 1 1 0000000.600 0000000001\n");
  };
  // The new owner dies as well, so that the run comes back and is made in the end.
  EXPECT_EQ(make(all, options)[0].state, RunState::kDone);
  EXPECT_TRUE(taken_over);
}

TEST_F(RunPoolTest, ANewAttemptRemovesTheOldSummaryBeforeItWritesTheNewScenario) {
  // A study that is killed right after this must not take the old results for those of the new scenario.
  directory_.put("summary.json", "{\"status\": \"ok\"}");
  directory_.put("scenario.yaml", "");
  // Killed right then: it does not get as far as the scenario.
  std::filesystem::create_directory(directory_.file("scenario.yaml.partial"));
  EXPECT_THROW(prepareRun(directory_.path(), toYaml(Scenario{}), "stamp\n"), OutputError);
  EXPECT_FALSE(std::filesystem::exists(directory_.file("summary.json")));
  std::filesystem::remove(directory_.file("scenario.yaml.partial"));
  prepareRun(directory_.path(), toYaml(Scenario{}), "stamp\n");
  EXPECT_EQ(readFile(directory_.file("scenario.yaml")), toYaml(Scenario{}));
}

TEST(ProgramStamp, HashIsFnv1a) {
  // Test vectors of RFC 9923 (FNV), 64 bits: "", "a" and "foobar".
  EXPECT_EQ(fnv1a(""), 0xcbf29ce484222325ull);
  EXPECT_EQ(fnv1a("a"), 0xaf63dc4c8601ec8cull);
  EXPECT_EQ(fnv1a("foobar"), 0x85944171f73967e8ull);
}

// ---- results.csv

class ResultsTest : public ::testing::Test {
 protected:
  ResultsTest() {
    study_ = readStudy(directory_.putStudy(
        "seeds: [1, 2]\ncases: [{name: a, settings: {ice.cohesion_pa: 100, title: 'A, \"quoted\"'}}, {name: b}]\n"));
    statuses_.resize(study_.runs.size());
    for (std::size_t i = 0; i < study_.runs.size(); ++i) {
      statuses_[i].state = RunState::kDone;
      const std::string run = directory_.file(runDirectory(study_, study_.runs[i]));
      std::filesystem::create_directories(run);
      std::ofstream(run + "/summary.json")
          << "{\n\"peak_force_n\": 1" << i << ".25,\n\"residual_force_n\": null,\n\"wall_s\": 3,\n"
          << "\"real_time_factor\": 2,\n\"ns_per_particle_step\": 9,\n\"threads\": 1,\n"
          << "\"state_hash\": \"00000000000000e" << i << "\",\n\"status\": \"ok\"\n}\n";
      std::ofstream(run + "/plug.csv") << "time_s,bulge_height_m\n0,0\n0.5,0." << i << "\n";
    }
  }

  StudyDirectory directory_;
  Study study_;
  std::vector<RunStatus> statuses_;
};

TEST_F(ResultsTest, TableHasARowPerRunAndTheColumnsOfTheContract) {
  EXPECT_EQ(resultsCsv(study_, directory_.path(), statuses_),
            "case,seed,status,title,ice.cohesion_pa,peak_force_n,residual_force_n,state_hash,time_s,bulge_height_m\n"
            "a,1,ok,\"A, \"\"quoted\"\"\",100,10.25,,00000000000000e0,0.5,0.0\n"
            "a,2,ok,\"A, \"\"quoted\"\"\",100,11.25,,00000000000000e1,0.5,0.1\n"
            "b,1,ok,Small field,200,12.25,,00000000000000e2,0.5,0.2\n"
            "b,2,ok,Small field,200,13.25,,00000000000000e3,0.5,0.3\n");
}

TEST_F(ResultsTest, FailedRunHasItsReasonAndNoFigures) {
  statuses_[0] = {RunState::kFailed, "exit code 1, last line: disk full", false};
  const std::string csv = resultsCsv(study_, directory_.path(), statuses_);
  EXPECT_NE(csv.find("\na,1,\"failed: exit code 1, last line: disk full\",\"A, \"\"quoted\"\"\",100,,,,,\na,2,ok,"),
            std::string::npos)
      << csv;
}

TEST_F(ResultsTest, MissingFilesOfAFinishedRunAreAnError) {
  std::filesystem::remove(directory_.file("runs/b/seed_1/plug.csv"));
  EXPECT_THROW(resultsCsv(study_, directory_.path(), statuses_), OutputError);
}

}  // namespace
}  // namespace brash_ice_rig
