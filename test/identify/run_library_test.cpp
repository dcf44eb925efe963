// With programs that only pretend to simulate.

#include "brash_ice_rig/identify/run_library.h"

#include <sys/stat.h>

#include <string>

#include <gtest/gtest.h>

#include "../output/shell.h"
#include "../output/temporary_directory.h"
#include "brash_ice_rig/output/output_file.h"

namespace brash_ice_rig {
namespace {

class RunLibraryTest : public ::testing::Test {
 protected:
  /// @param script  $4 is the directory of the run
  RunPoolOptions programThat(const std::string& script) const {
    RunPoolOptions pool;
    pool.program = directory_.put("program", "#!/bin/sh\n" + script);
    chmod(pool.program.c_str(), 0755);
    return pool;
  }

  TemporaryDirectory directory_;
};

TEST_F(RunLibraryTest, AWorldThatFreezesSaysThatItsParametersCannotBeSimulated) {
  RunLibrary runs(directory_.file("runs"),
                  programThat("printf '{\"status\": \"non_finite: why\"}' > \"$4/summary.json\"; exit 1\n"));
  const std::string key = runs.request(Scenario{});
  runs.makeMissing("test");
  EXPECT_TRUE(runs.failed(key));
}

TEST_F(RunLibraryTest, ARunThatCouldNotBeMadeSaysNothingAboutItsParameters) {
  for (const char* script : {"echo 'force.csv: No space left on device'; exit 1\n", "kill -9 $$\n"}) {
    RunLibrary runs(directory_.file("runs"), programThat(script));
    const std::string key = runs.request(Scenario{});
    try {
      runs.makeMissing("test");
      FAIL() << script;
    } catch (const OutputError& error) {
      EXPECT_TRUE(contains(error.what(), key)) << error.what();
      EXPECT_TRUE(contains(error.what(), script[0] == 'e' ? "No space left on device" : "signal 9")) << error.what();
    }
    EXPECT_FALSE(runs.failed(key));
  }
}

}  // namespace
}  // namespace brash_ice_rig
