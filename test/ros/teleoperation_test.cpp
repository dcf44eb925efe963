#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <regex>
#include <string>
#include <vector>

#include <fcntl.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <geometry_msgs/TwistStamped.h>
#include <sensor_msgs/Joy.h>
#include <std_msgs/Float64.h>

#include "brash_ice_rig/CraneState.h"
#include "test_support.h"

namespace brash_ice_rig {
namespace {

constexpr double kCommanderMemoryS = 1.1;  // the node's, and a bit

/// The node of teleoperation_test.test is in manual control; the collector hangs folded above the ice.
class Teleoperation : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(commands_.waitForConnection());
    ASSERT_TRUE(callTrigger("rig_node/reset").success);
    ASSERT_TRUE(crane_.waitForNew([](const CraneState& state) { return state.stage == "manual"; }));
  }
  void TearDown() override {
    if (!commands_.arrivals_s.empty()) last_command_s = commands_.arrivals_s.back();
  }

  double speed() const { return crane_.last().velocity_mps.z; }
  bool waitForSpeed(double speed_mps) {
    return crane_.waitForNew([&](const CraneState& s) { return std::abs(s.velocity_mps.z - speed_mps) < 1e-9; });
  }

  /// The commands end with one zero, and the crane has stopped by it and not by its watchdog.
  void expectOneZeroThenSilence() {
    ASSERT_TRUE(waitForSpeed(0.0));
    spinFor(0.5);
    ASSERT_GE(commands_.messages.size(), 2u);
    const std::size_t count = commands_.messages.size();
    EXPECT_EQ(commands_.messages[count - 1].twist.linear.z, 0.0);
    EXPECT_NE(commands_.messages[count - 2].twist.linear.z, 0.0) << "one zero only";
    EXPECT_LT(commands_.arrivals_s.back(), ros::SteadyTime::now().toSec() - 0.4) << "silent since";
    for (const SimStatus& status : status_.messages) EXPECT_FALSE(hasFlag(status, SimStatus::COMMAND_TIMEOUT));
  }

  ros::NodeHandle node_;
  Listener<CraneState> crane_{"crane/state"};
  Listener<SimStatus> status_{"sim/status"};
  Listener<geometry_msgs::TwistStamped> commands_{"crane/cmd_vel"};
  static double last_command_s;
};

double Teleoperation::last_command_s = 0.0;

// ----------------------------------------------------------------------------------------------------------- joystick

class JoyTeleoperation : public Teleoperation {
 protected:
  void SetUp() override {
    publisher_ = node_.advertise<sensor_msgs::Joy>("joy", 1);
    ASSERT_TRUE(waitFor([&] { return publisher_.getNumSubscribers() > 0; }));
    Teleoperation::SetUp();
    for (int i = 0; i < 3; ++i) hold(makeJoy(false, 0.0f), 0.05);
  }

  /// A message in the layout of gamepad.yaml.
  static sensor_msgs::Joy makeJoy(bool deadman, float hoist, bool fold = false, bool unfold = false) {
    sensor_msgs::Joy joy;
    joy.axes.assign(6, 0.0f);
    joy.buttons.assign(15, 0);
    joy.axes[1] = hoist;
    joy.buttons[9] = deadman ? 1 : 0;
    joy.buttons[0] = fold ? 1 : 0;
    joy.buttons[3] = unfold ? 1 : 0;
    return joy;
  }

  /// Repeats a message 20 times a second until the condition holds.
  bool holdUntil(const sensor_msgs::Joy& joy, const std::function<bool()>& condition, double timeout_s = 10.0) {
    for (double waited_s = 0.0; waited_s < timeout_s; waited_s += 0.05) {
      publisher_.publish(joy);
      if (waitFor(condition, 0.05)) return true;
    }
    return false;
  }
  void hold(const sensor_msgs::Joy& joy, double duration_s) {
    holdUntil(
        joy, [] { return false; }, duration_s);
  }

  ros::Publisher publisher_;
};

TEST_F(JoyTeleoperation, StickMovesTheHoistAndSilenceStopsIt) {
  // Full deflection is 0.2 m/s in gamepad.yaml.
  ASSERT_TRUE(holdUntil(makeJoy(true, 1.0f), [&] { return std::abs(speed() - 0.2) < 1e-9; }));
  expectOneZeroThenSilence();
}

TEST_F(JoyTeleoperation, ReleasedDeadManStopsItAlthoughTheStickIsDeflected) {
  ASSERT_TRUE(holdUntil(makeJoy(true, -1.0f), [&] { return std::abs(speed() + 0.2) < 1e-9; }));
  hold(makeJoy(false, -1.0f), 0.6);
  expectOneZeroThenSilence();
  const double rest_m = crane_.last().position_m.z;
  hold(makeJoy(false, 1.0f), 0.3);
  EXPECT_EQ(crane_.last().position_m.z, rest_m);
}

TEST_F(JoyTeleoperation, ButtonsUnfoldAndFold) {
  EXPECT_TRUE(holdUntil(makeJoy(true, 0.0f, false, true), [&] { return crane_.last().fold_target == 1.0; }));
  EXPECT_TRUE(holdUntil(makeJoy(true, 0.0f, true), [&] { return crane_.last().fold_target == 0.0; }));
}

// ----------------------------------------------------------------------------------------------------------- keyboard

/// teleop_key on a terminal of its own.
class KeyTeleoperation : public Teleoperation {
 protected:
  void SetUp() override {
    Teleoperation::SetUp();
    master_ = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    ASSERT_GE(master_, 0);
    ASSERT_EQ(grantpt(master_), 0);
    ASSERT_EQ(unlockpt(master_), 0);
    terminal_name_ = ptsname(master_);
    fcntl(master_, F_SETFL, O_NONBLOCK);
    // Kept open: a terminal that nobody has open forgets its modes.
    slave_ = open(terminal_name_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
    const winsize size{24, 80, 0, 0};
    ioctl(slave_, TIOCSWINSZ, &size);
    ASSERT_EQ(tcgetattr(slave_, &modes_before_), 0);
    child_ = fork();
    if (child_ == 0) {
      setsid();
      const int terminal = open(terminal_name_.c_str(), O_RDWR);  // becomes the controlling one
      dup2(terminal, STDIN_FILENO);
      dup2(terminal, STDOUT_FILENO);
      dup2(terminal, STDERR_FILENO);
      execl(TELEOP_KEY, "teleop_key", "--ns", "/", "--speed", "0.1", nullptr);
      _exit(99);
    }
    // Whoever has moved the crane in the test before is forgotten.
    ASSERT_TRUE(waitFor([] { return ros::SteadyTime::now().toSec() - last_command_s > kCommanderMemoryS; }));
    ASSERT_TRUE(waitForScreen("kN"));
    ASSERT_TRUE(commands_.waitForConnection());
    ASSERT_TRUE(waitFor([this] { return status_.messages.size() > 2; }));
  }

  void TearDown() override {
    if (child_ > 0) {
      kill(child_, SIGKILL);
      waitpid(child_, nullptr, 0);
    }
    close(slave_);
    close(master_);
    Teleoperation::TearDown();
  }

  void readScreen() {
    char buffer[4096];
    for (ssize_t count; (count = read(master_, buffer, sizeof buffer)) > 0;) {
      screen_.append(buffer, static_cast<std::size_t>(count));
    }
  }
  bool waitForScreen(const std::string& text) {
    return waitFor([&] {
      readScreen();
      return screen_.find(text) != std::string::npos;
    });
  }
  void type(const std::string& keys) {
    ASSERT_EQ(write(master_, keys.data(), keys.size()), static_cast<ssize_t>(keys.size()));
  }
  /// As a keyboard repeats a key that is held.
  bool holdUntil(const std::string& key, const std::function<bool()>& condition, double timeout_s = 10.0) {
    for (double waited_s = 0.0; waited_s < timeout_s; waited_s += 0.033) {
      type(key);
      readScreen();
      if (waitFor(condition, 0.033)) return true;
    }
    return false;
  }

  int waitForExit() {
    int status = -1;
    EXPECT_TRUE(waitFor([&] {
      readScreen();
      return waitpid(child_, &status, WNOHANG) == child_;
    }));
    child_ = 0;
    readScreen();
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  void expectTerminalAsBefore() {
    termios modes{};
    ASSERT_EQ(tcgetattr(slave_, &modes), 0);
    EXPECT_EQ(modes.c_lflag, modes_before_.c_lflag);
    EXPECT_EQ(modes.c_iflag, modes_before_.c_iflag);
    EXPECT_EQ(modes.c_oflag, modes_before_.c_oflag);
    EXPECT_EQ(std::memcmp(modes.c_cc, modes_before_.c_cc, sizeof modes.c_cc), 0);
    EXPECT_GT(screen_.rfind("\x1b[?25h"), screen_.rfind("\x1b[?25l")) << "the cursor is back";
  }

  int master_ = -1, slave_ = -1;
  std::string terminal_name_, screen_;
  termios modes_before_{};
  pid_t child_ = 0;
};

TEST_F(KeyTeleoperation, HeldKeyMovesTheHoistAndReleaseStopsIt) {
  ASSERT_TRUE(holdUntil("w", [&] { return std::abs(speed() - 0.1) < 1e-9; }));
  expectOneZeroThenSilence();
  EXPECT_GT(crane_.last().hoist_position_m, crane_.first().hoist_position_m);
}

TEST_F(KeyTeleoperation, ShowsForceHeightAndSpeedLive) {
  ASSERT_TRUE(waitForScreen("force"));
  ASSERT_TRUE(holdUntil("\x1b[B", [&] { return std::abs(speed() + 0.1) < 1e-9; }));
  // Collector and pole, 190 kg, hang in the air.
  EXPECT_NE(screen_.find("+1.864 kN"), std::string::npos) << screen_;
  EXPECT_NE(screen_.find("height"), std::string::npos);
  EXPECT_TRUE(holdUntil("\x1b[B", [&] { return screen_.find("-0.100 m/s") != std::string::npos; })) << screen_;
  EXPECT_NE(screen_.find("MOVES"), std::string::npos);
}

TEST_F(KeyTeleoperation, FlagStaysOnTheScreenLongEnoughToBeRead) {
  auto fold_publisher = node_.advertise<std_msgs::Float64>("collector/cmd_fold", 1);
  ASSERT_TRUE(waitFor([&] { return fold_publisher.getNumSubscribers() > 0; }));
  std_msgs::Float64 wrong;
  wrong.data = 7.0;
  fold_publisher.publish(wrong);
  ASSERT_TRUE(waitForScreen("command_rejected: ")) << screen_;
  ASSERT_TRUE(status_.waitForNew([](const SimStatus& status) { return status.flags == 0; }));
  spinFor(0.3);
  readScreen();
  screen_.clear();
  EXPECT_TRUE(waitForScreen("command_rejected: "));
}

TEST_F(KeyTeleoperation, LinesFitIntoEightyColumns) {
  spinFor(0.5);
  readScreen();
  const std::string plain = std::regex_replace(screen_, std::regex("\x1b\\[[?0-9;]*[A-Za-z]|\r"), "");
  ASSERT_NE(plain.find("q: quit"), std::string::npos) << plain;
  std::size_t longest = 0;
  for (std::size_t begin = 0; begin < plain.size();) {
    const std::size_t end = std::min(plain.find('\n', begin), plain.size());
    longest = std::max(longest, end - begin);
    begin = end + 1;
  }
  EXPECT_LT(longest, 80u) << "the end of the line is erased behind it\n" << plain;
}

TEST_F(KeyTeleoperation, KeysUnfoldAndSpaceHoldsTheArmsWhereTheyAre) {
  type("o");
  ASSERT_TRUE(crane_.waitForNew([](const CraneState& s) { return s.fold_target == 1.0 && s.fold_ratio > 0.02; }));
  type(" ");
  ASSERT_TRUE(crane_.waitForNew([](const CraneState& s) { return s.fold_target < 0.5; }));
  ASSERT_TRUE(crane_.waitForNew([](const CraneState& s) { return std::abs(s.fold_ratio - s.fold_target) < 1e-6; }));
}

TEST_F(KeyTeleoperation, QuitStopsTheCraneAndGivesTheTerminalBack) {
  ASSERT_TRUE(holdUntil("w", [&] { return speed() > 0.05; }));
  type("q");
  EXPECT_EQ(waitForExit(), 0);
  expectTerminalAsBefore();
  expectOneZeroThenSilence();
}

TEST_F(KeyTeleoperation, SignalsStopTheCraneAndGiveTheTerminalBack) {
  ASSERT_TRUE(holdUntil("w", [&] { return speed() > 0.05; }));
  kill(child_, SIGTERM);
  EXPECT_EQ(waitForExit(), 128 + SIGTERM);
  expectTerminalAsBefore();
  expectOneZeroThenSilence();
}

TEST_F(KeyTeleoperation, CtrlCEndsItInOrder) {
  type("\x03");
  EXPECT_EQ(waitForExit(), 0);
  expectTerminalAsBefore();
}

TEST_F(KeyTeleoperation, CrashGivesTheTerminalBackAndTheWatchdogStopsTheCrane) {
  ASSERT_TRUE(holdUntil("w", [&] { return std::abs(speed() - 0.1) < 1e-9; }));
  kill(child_, SIGSEGV);
  EXPECT_EQ(waitForExit(), -1) << "killed by the signal";
  expectTerminalAsBefore();
  EXPECT_TRUE(waitForSpeed(0.0));
  EXPECT_TRUE(waitFor([this] { return hasFlag(status_.last(), SimStatus::COMMAND_TIMEOUT); }));
}

TEST(TeleopKey, WithoutATerminalItSaysSo) {
  const int status = std::system(TELEOP_KEY " --ns / < /dev/null > /dev/null 2>&1");
  EXPECT_EQ(WEXITSTATUS(status), 2);
  EXPECT_EQ(WEXITSTATUS(std::system(TELEOP_KEY " --speed 7 < /dev/null > /dev/null 2>&1")), 2);
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  return brash_ice_rig::runRosTest(argc, argv, "teleoperation_test");
}
