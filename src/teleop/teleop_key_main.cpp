// teleop_key: crane and fold of a rig by single keys, with its force, height and speed. doc/ros_api.md.
// Exit codes: 0 ended by q or Ctrl-C, 1 no ROS master, 2 bad input or no terminal, 128 + n ended by signal n.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <exception>
#include <map>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <CLI/CLI.hpp>

#include "brash_ice_rig/CraneState.h"
#include "brash_ice_rig/SimStatus.h"
#include "brash_ice_rig/node/service_call.h"
#include "brash_ice_rig/node/topic_names.h"
#include "brash_ice_rig/teleop/command_publisher.h"
#include "brash_ice_rig/teleop/key_teleop.h"
#include "brash_ice_rig/teleop/terminal.h"

namespace brash_ice_rig {
namespace {

constexpr double kSendPeriodS = 0.05;
constexpr double kShowPeriodS = 0.1;
constexpr double kSilentAfterS = 1.5;  // wall time; a paused rig still sends five times a second
constexpr int kReadTimeoutMs = 10;
constexpr std::size_t kRemedyLines = 3;
/// Flags are raised for a fifth of a second at a time: keep each on the screen long enough to read it.
constexpr double kFlagStaysS = 4.0;

double nowSeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

/// Breaks a text at blanks.
std::vector<std::string> wrap(const std::string& text, std::size_t width) {
  std::vector<std::string> lines(1);
  std::size_t begin = 0;
  while (begin < text.size()) {
    const std::size_t end = std::min(text.find(' ', begin), text.size());
    const std::string word = text.substr(begin, end - begin);
    if (!lines.back().empty() && lines.back().size() + 1 + word.size() > width) lines.emplace_back();
    lines.back() += (lines.back().empty() ? "" : " ") + word;
    begin = end + 1;
  }
  return lines;
}

class KeyTeleopProgram {
 public:
  KeyTeleopProgram(const std::string& rig, double speed_mps) : node_(rig), commands_(node_), teleop_(speed_mps) {
    wrench_subscriber_ = node_.subscribe<geometry_msgs::WrenchStamped>(
        topics::kWrench, 1, [this](const geometry_msgs::WrenchStamped::ConstPtr& m) { force_n_ = m->wrench.force.z; });
    crane_subscriber_ =
        node_.subscribe<CraneState>(topics::kCraneState, 1, [this](const CraneState::ConstPtr& m) { crane_ = *m; });
    status_subscriber_ = node_.subscribe<SimStatus>(topics::kSimStatus, 1, [this](const SimStatus::ConstPtr& m) {
      status_ = *m;
      heard_s_ = nowSeconds();
      for (std::size_t i = 0; i < std::min(m->flag_names.size(), m->remedies.size()); ++i) {
        flags_[m->flag_names[i]] = {m->remedies[i], heard_s_};
      }
    });
  }

  /// Until a key, a signal or ROS ends it.
  void run() {
    Terminal terminal;
    double next_send_s = 0.0, next_show_s = 0.0;
    while (!quit_ && !terminal.closed() && endingSignal() == 0 && ros::ok()) {
      for (const Key key : reader_.read(terminal.read(kReadTimeoutMs))) press(key);
      ros::spinOnce();
      const double now_s = nowSeconds();
      if (now_s >= next_send_s) {
        commands_.send(teleop_.update(now_s));
        next_send_s = now_s + kSendPeriodS;
      }
      if (now_s >= next_show_s) {
        terminal.show(lines(static_cast<std::size_t>(terminal.size().columns), now_s));
        next_show_s = now_s + kShowPeriodS;
      }
    }
    if (teleop_.moving()) commands_.send(teleop_.press(Key::kQuit, nowSeconds(), {}));
    // Publishing only queues: give the zero the time to leave.
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }

 private:
  void press(Key key) {
    const bool known = crane_.has_value();
    if (key == Key::kTare) tare();
    if (key == Key::kQuit) quit_ = true;
    commands_.send(teleop_.press(key, nowSeconds(), known ? std::optional<double>(crane_->fold_ratio) : std::nullopt));
  }

  void tare() {
    std_srvs::Trigger trigger;
    const std::string service = node_.resolveName(services::kTare);
    note_ = "tare: " + (callService(service, trigger) ? trigger.response.message : "no answer from " + service);
  }

  std::vector<std::string> lines(std::size_t width, double now_s) const {
    const bool alive = status_ && now_s - heard_s_ < kSilentAfterS;
    std::vector<std::string> shown = {
        "\x1b[1mRig " + node_.getNamespace() + "\x1b[0m" +
        (alive ? format("   t %.1f s   real-time factor %.2f%s", status_->time_s, status_->real_time_factor,
                        status_->frozen   ? "   FROZEN"
                        : status_->paused ? "   PAUSED"
                                          : "")
               : std::string("   no answer"))};
    shown.emplace_back();
    if (crane_ && force_n_) {
      shown.push_back(format("  force   %+9.3f kN    peak %+9.3f kN (1 s mean)", 1e-3 * *force_n_,
                             status_ ? 1e-3 * status_->peak_force_n : std::nan("")));
      shown.push_back(format("  height  %+9.3f m     of the hub over the waterline", crane_->hoist_position_m));
      shown.push_back(format("  speed   %+9.3f m/s   boom x %+.3f, y %+.3f m/s", crane_->velocity_mps.z,
                             crane_->velocity_mps.x, crane_->velocity_mps.y));
      shown.push_back(format("  fold    %9.2f       0 folded, 1 unfolded; %s", crane_->fold_ratio,
                             crane_->locked ? "locked" : "not locked"));
    } else {
      shown.insert(shown.end(), {"  force", "  height", "  speed", "  fold"});
    }
    shown.emplace_back();
    shown.push_back(teleop_.moving() ? format("  \x1b[7m MOVES \x1b[0m at %.3f m/s", teleop_.speed())
                                     : format("  still    a held key moves at %.3f m/s", teleop_.speed()));
    shown.emplace_back("  hold  w s or arrows up, down: hoist   a d or arrows: boom x   r f: boom y");
    shown.emplace_back("  press o c: open, close arms   + -: speed   space: stop   t: tare   q: quit");
    shown.push_back("  " + note_);
    std::string flags;
    if (!alive) flags = "Launch the rig with: roslaunch brash_ice_rig pull_up.launch teleop:=true";
    for (const auto& [name, flag] : flags_) {
      if (alive && now_s - flag.seen_s < kFlagStaysS) flags += (flags.empty() ? "" : " ") + name + ": " + flag.remedy;
    }
    std::vector<std::string> wrapped = wrap(flags, width > 4 ? width - 3 : 1);
    wrapped.resize(kRemedyLines);
    for (const std::string& line : wrapped) shown.push_back("  " + line);
    return shown;
  }

  struct RaisedFlag {
    std::string remedy;
    double seen_s;
  };

  ros::NodeHandle node_;
  CommandPublisher commands_;
  KeyTeleop teleop_;
  KeyReader reader_;
  bool quit_ = false;
  std::string note_;
  std::optional<double> force_n_;
  std::optional<CraneState> crane_;
  std::optional<SimStatus> status_;
  double heard_s_ = 0.0;
  std::map<std::string, RaisedFlag> flags_;
  ros::Subscriber wrench_subscriber_, crane_subscriber_, status_subscriber_;
};

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  using namespace brash_ice_rig;
  ros::init(argc, argv, "teleop_key",
            ros::init_options::AnonymousName | ros::init_options::NoSigintHandler | ros::init_options::NoRosout);
  CLI::App app("Moves crane and arms of a rig by single keys and shows its force, height and speed.");
  std::string rig;
  double speed_mps = 0.05;
  app.add_option("--ns", rig, "namespace of the rig (default: rig, or that of this node)");
  app.add_option("--speed", speed_mps, "speed to begin with, m/s")
      ->check(CLI::Range(KeyTeleop::kSlowestMps, KeyTeleop::kFastestMps))
      ->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (rig.empty() && ros::this_node::getNamespace() == "/") rig = "rig";
  if (!rig.empty() && rig.front() != '/') rig.insert(rig.begin(), '/');
  if (!ros::master::check()) {
    std::fprintf(
        stderr,
        "teleop_key: no ROS master; launch the rig first: roslaunch brash_ice_rig pull_up.launch teleop:=true\n");
    return 1;
  }
  try {
    KeyTeleopProgram(rig, speed_mps).run();
  } catch (const std::system_error& error) {
    std::fprintf(stderr, "teleop_key: %s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "teleop_key: %s\n", error.what());
    return 1;
  }
  const int signal = endingSignal();
  return signal == 0 || signal == SIGINT ? 0 : 128 + signal;
}
