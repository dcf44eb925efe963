#include "brash_ice_rig/rig/crane_motion.h"

#include <sys/stat.h>

#include <fstream>

#include <gtest/gtest.h>

#include "../output/temporary_directory.h"
#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/simulation/simulation.h"

namespace brash_ice_rig {
namespace {

std::string written(const TemporaryDirectory& directory, const std::string& text) {
  const std::string path = directory.path() + "/motion.csv";
  std::ofstream(path) << text;
  return path;
}

std::string refusal(const std::string& path) {
  try {
    CraneMotion::read(path);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "taken";
}

TEST(CraneMotion, IsStraightBetweenItsCornersAndRestsBeyondThem) {
  const CraneMotion motion({1.0, 3.0, 4.0}, {-2.0, -1.0, -1.5});
  EXPECT_EQ(motion.wayAt(0.0), 0.0);
  EXPECT_DOUBLE_EQ(motion.wayAt(2.0), 0.5);
  EXPECT_DOUBLE_EQ(motion.wayAt(3.5), 0.75);
  EXPECT_DOUBLE_EQ(motion.wayAt(9.0), 0.5);
  EXPECT_DOUBLE_EQ(motion.highest(), 1.0);
  EXPECT_DOUBLE_EQ(motion.lowest(), 0.0);
  EXPECT_DOUBLE_EQ(motion.fastest(), 0.5);
}

TEST(CraneMotion, FileThatIsNoMotionIsRefusedWithItsLine) {
  const TemporaryDirectory directory;
  EXPECT_NE(refusal(directory.path() + "/none.csv").find("none.csv"), std::string::npos);
  EXPECT_NE(refusal(written(directory, "time_s,height\n0,1\n1,1\n")).find("hoist_position_m"), std::string::npos);
  EXPECT_NE(refusal(written(directory, "time_s,hoist_position_m\n0,1\n")).find("two rows"), std::string::npos);
  EXPECT_NE(refusal(written(directory, "time_s,hoist_position_m\n0,1\n1,nan\n")).find("line 3"), std::string::npos);
  EXPECT_NE(refusal(written(directory, "time_s,hoist_position_m\n-1,1\n1,1\n")).find("negative"), std::string::npos);
  EXPECT_NE(refusal(written(directory, "time_s,hoist_position_m\n0,1\n1,1\n1,2\n")).find("increase"),
            std::string::npos);
}

TEST(CraneMotion, FileThatWouldKeepItsReaderWaitingIsRefused) {
  const TemporaryDirectory directory;
  const std::string pipe = directory.path() + "/pipe.csv";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_NE(refusal(pipe).find("is not a regular file"), std::string::npos) << refusal(pipe);
  EXPECT_NE(refusal("/proc/kmsg"), "taken");
}

Scenario smallTest(const std::string& motion_file) {
  Scenario s;
  s.field.length_x_m = s.field.length_y_m = 3.0;
  s.field.thickness_m = 0.6;
  s.collector.radius_m = 0.6;
  s.solver.threads = 1;
  s.procedure.settle_duration_s = 0.1;
  s.procedure.motion_file = motion_file;
  return s;
}

TEST(CraneMotion, HubFollowsTheWayOfTheFileAndTheTestEndsWithIt) {
  const TemporaryDirectory directory;
  const std::string path = written(directory, "time_s,hoist_position_m\n0,7\n0.5,7\n2.5,7.2\n3,7.2\n4,7.1\n4.5,7.1\n");
  const CraneMotion motion = CraneMotion::read(path);
  const Scenario s = smallTest(path);
  Simulation simulation(s);
  const double start = startHubHeight(s);
  while (!simulation.finished()) {
    simulation.advance(simulation.samplePeriod());
    const Snapshot now = simulation.snapshot();
    // A ramp of 0.1 m/s at 0.5 m/s² errs by 10 mm, until the next one.
    ASSERT_NEAR(now.rig.hoist_position_m, start + motion.wayAt(now.time_s), 0.0105) << now.time_s;
    ASSERT_LT(now.time_s, 5.0);
  }
  EXPECT_NEAR(simulation.snapshot().time_s, 4.5, 0.011);
  EXPECT_NEAR(simulation.snapshot().rig.hoist_position_m, start + 0.1, 0.001);
}

TEST(CraneMotion, TooFastOrTooHighForTheCraneIsRefusedBeforeTheTest) {
  const TemporaryDirectory directory;
  EXPECT_THROW(smallTest(written(directory, "time_s,hoist_position_m\n0,0\n1,2\n")).validate(), ConfigError);
  EXPECT_THROW(smallTest(written(directory, "time_s,hoist_position_m\n0,0\n200,20\n")).validate(), ConfigError);
  EXPECT_NO_THROW(smallTest(written(directory, "time_s,hoist_position_m\n0,0\n20,2\n")).validate());
}

}  // namespace
}  // namespace brash_ice_rig
