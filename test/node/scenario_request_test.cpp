#include "brash_ice_rig/node/scenario_request.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "brash_ice_rig/config/config_error.h"

namespace brash_ice_rig {
namespace {

namespace fs = std::filesystem;

class ScenarioRequest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(allowed_ / "simulations");
    fs::create_directories(scratch_ / "allowed_too");
    for (const char* file : {"allowed/a.yaml", "allowed/simulations/b.yaml", "secret.yaml", "allowed_too/c.yaml"}) {
      std::ofstream(scratch_ / file) << "title: x\n";
    }
    fs::create_symlink(scratch_ / "secret.yaml", allowed_ / "link.yaml");
  }
  void TearDown() override { fs::remove_all(scratch_); }

  ScenarioSources resolve(const std::string& scenario, const std::string& overlays = "",
                          const std::string& settings = "") const {
    LoadScenarioRequest request;
    request.scenario = scenario;
    request.overlays = overlays;
    request.settings = settings;
    return resolveScenarioRequest(request, allowed_.string(), {"/present.yaml", {"old.yaml"}, {"old.key=1"}});
  }

  std::string refusal(const std::string& scenario, const std::string& overlays = "",
                      const std::string& settings = "") const {
    try {
      resolve(scenario, overlays, settings);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "taken";
  }

  const fs::path scratch_ =
      fs::canonical(fs::temp_directory_path()) / ("brash_ice_rig_request_" + std::to_string(getpid()));
  const fs::path allowed_ = scratch_ / "allowed";
};

TEST_F(ScenarioRequest, FilesBelowTheDirectoryAreTaken) {
  const ScenarioSources sources = resolve("simulations/../a.yaml", "simulations/b.yaml; a.yaml", "a.b=1; c.d=2");
  EXPECT_EQ(sources.file, (allowed_ / "a.yaml").string());
  EXPECT_EQ(sources.overlays,
            (std::vector<std::string>{(allowed_ / "simulations/b.yaml").string(), (allowed_ / "a.yaml").string()}));
  EXPECT_EQ(sources.settings, (std::vector<std::string>{"a.b=1", "c.d=2"}));
  EXPECT_EQ(resolve((allowed_ / "a.yaml").string()).file, (allowed_ / "a.yaml").string());
}

TEST_F(ScenarioRequest, WithoutAFileItIsThePresentOneAndNothingOfTheRest) {
  const ScenarioSources sources = resolve("", "", "x.y=2");
  EXPECT_EQ(sources.file, "/present.yaml");
  EXPECT_TRUE(sources.overlays.empty());
  EXPECT_EQ(sources.settings, (std::vector<std::string>{"x.y=2"}));
}

TEST_F(ScenarioRequest, FilesElsewhereAreRefusedByAnyPath) {
  for (const std::string name : {"../secret.yaml", "simulations/../../secret.yaml", "link.yaml", "/etc/hostname",
                                 "../allowed_too/c.yaml", "missing.yaml", "simulations", "."}) {
    const std::string rule = "\"" + name + "\", must be a file below " + allowed_.string();
    EXPECT_EQ(refusal(name), "scenario = " + rule);
    EXPECT_EQ(refusal("a.yaml", name), "overlays = " + rule);
  }
  EXPECT_EQ(refusal("a.yaml", "", "procedure.motion_file=/etc/passwd"),
            "settings = \"procedure.motion_file=/etc/passwd\", must not name a file; a scenario file may");
  EXPECT_NE(refusal("a.yaml", "", "ice.void_fraction=0.5; procedure.commands_file = x"), "taken");
}

TEST_F(ScenarioRequest, RigThatMovesIsNotReplaced) {
  Snapshot snapshot;
  for (const Stage stage : {Stage::kLower, Stage::kUnfold, Stage::kLift}) {
    snapshot.stage = stage;
    EXPECT_EQ(reasonAgainstLoad(snapshot), std::string("the rig is in stage ") + stageName(stage) +
                                               "; wait for the end of the lift, or call ~reset first");
  }
  for (const Stage stage : {Stage::kSettle, Stage::kHold, Stage::kDone, Stage::kManual}) {
    snapshot.stage = stage;
    EXPECT_EQ(reasonAgainstLoad(snapshot), "") << stageName(stage);
  }
  snapshot.rig.crane_velocity_mps.z() = 0.01;
  EXPECT_EQ(reasonAgainstLoad(snapshot), "the crane moves; let it stop first");
}

}  // namespace
}  // namespace brash_ice_rig
