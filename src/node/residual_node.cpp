// residual_node: says while a test runs, or is replayed, whether measured and simulated force differ by more than noise
// and the model's own error (doc/ros_api.md, section Residual). Exit codes: 0 done, 2 bad input.

#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include "brash_ice_rig/CraneState.h"
#include "brash_ice_rig/ForceResidual.h"
#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/node/live_residual.h"
#include "brash_ice_rig/node/loopback.h"
#include "brash_ice_rig/node/parameter_reader.h"
#include "brash_ice_rig/node/topic_names.h"

namespace brash_ice_rig {
namespace {

constexpr double kLookIntervalS = 0.1;  // wall time between two looks for completed bins
constexpr double kSilenceS = 2.0;       // wall time after which a topic counts as missing, and between two reminders
constexpr double kJumpBackS = 5.0;      // a stamp older than the newest by more than this: another clock
constexpr double kRestingSpeedMps = 1.0e-4;  // of the hoist
constexpr char kLearnedNoise[] = "learned_noise";

struct Options {
  LiveResidualSettings settings;
  double white_noise_n = std::numeric_limits<double>::quiet_NaN();
  double slow_noise_n = 0.0;
  double slow_noise_time_s = 2.0;
};

Options readOptions(const ros::NodeHandle& private_node) {
  Options options;
  LiveResidualSettings& settings = options.settings;
  ParameterReader reader(private_node);
  reader.allow(kLearnedNoise);  // our own, see remember()
  reader.read("bin_rate_hz", settings.bin_rate_hz, 0.1, 100.0);
  reader.read("window_s", settings.window_s, 1.0, 3600.0);
  reader.read("learn_s", settings.learn_s, 1.0, 600.0);
  reader.read("lateness_s", settings.lateness_s, 0.0, 10.0);
  reader.read("discrepancy_ratio", settings.discrepancy_ratio, 0.0, 1.0);
  reader.read("discrepancy_time_s", settings.discrepancy_time_s, 0.01, 600.0);
  reader.read("noise_floor_n", settings.noise_floor_n, 1.0e-3, 1.0e5);
  reader.read("significance_p", settings.significance_p, 1.0e-12, 0.5);
  reader.read("white_noise_n", options.white_noise_n, 0.0, 1.0e6);
  reader.read("slow_noise_n", options.slow_noise_n, 0.0, 1.0e6);
  reader.read("slow_noise_time_s", options.slow_noise_time_s, 0.01, 600.0);
  reader.refuseUnknown();
  if (!std::isnan(options.white_noise_n)) {
    ResidualNoise noise;
    noise.white_n = options.white_noise_n;
    noise.slow_n = options.slow_noise_n;
    noise.slow_time_s = options.slow_noise_time_s;
    settings.noise = noise;
  }
  return options;
}

class ResidualNode {
 public:
  ResidualNode()
      : private_node_("~"),
        settings_(readOptions(private_node_).settings),
        noise_given_(settings_.noise.has_value()),
        residual_(settings_) {
    if (!noise_given_) recall();
    publisher_ = node_.advertise<ForceResidual>(topics::kResidual, 100);
    measured_subscriber_ = listen(topics::kMeasuredWrench, measured_heard_, [this](double stamp_s, double force_n) {
      startAnewIfEarlier(stamp_s, residual_.newestMeasured());
      residual_.addMeasured(stamp_s, force_n);
    });
    simulated_subscriber_ = listen(topics::kWrench, simulated_heard_, [this](double stamp_s, double force_n) {
      startAnewIfEarlier(stamp_s, residual_.newestSimulated());
      residual_.addSimulated(stamp_s, force_n);
    });
    crane_subscriber_ = node_.subscribe<CraneState>(
        topics::kCraneState, 10,
        boost::function<void(const CraneState::ConstPtr&)>([this](const CraneState::ConstPtr& state) {
          if (std::abs(state->velocity_mps.z) > kRestingSpeedMps) onMotion();
        }));
    restart_service_ = private_node_.advertiseService<std_srvs::Trigger::Request, std_srvs::Trigger::Response>(
        "restart", boost::function<bool(std_srvs::Trigger::Request&, std_srvs::Trigger::Response&)>(
                       [this](std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
                         private_node_.deleteParam(kLearnedNoise);
                         if (!noise_given_) settings_.noise.reset();
                         startAnew();
                         response.success = true;
                         response.message = noise_given_ ? "started anew" : "started anew; learning the noise";
                         return true;
                       }));
    timer_ = node_.createWallTimer(ros::WallDuration(kLookIntervalS), [this](const ros::WallTimerEvent&) { look(); });
  }

 private:
  template <class Handler>
  ros::Subscriber listen(const char* topic, ros::WallTime& heard, Handler handler) {
    return node_.subscribe<geometry_msgs::WrenchStamped>(
        topic, 1000,
        boost::function<void(const geometry_msgs::WrenchStamped::ConstPtr&)>(
            [&heard, handler](const geometry_msgs::WrenchStamped::ConstPtr& wrench) {
              heard = ros::WallTime::now();
              handler(wrench->header.stamp.toSec(), wrench->wrench.force.z);
            }));
  }

  void startAnewIfEarlier(double stamp_s, const std::optional<double>& newest_s) {
    if (!newest_s || stamp_s > *newest_s - kJumpBackS) return;
    ROS_WARN("stamps went back from %.2f to %.2f s, another run: started anew", *newest_s, stamp_s);
    startAnew();
  }

  void startAnew() {
    residual_ = LiveResidual(settings_);
    was_significant_ = moved_while_learning_ = false;
  }

  /// The noise has to be learned at rest.
  void onMotion() {
    if (residual_.noise()) return;
    look();  // what came before counts
    residual_.stopLearning();
    if (!residual_.noise() && residual_.learnedBins() > 0) moved_while_learning_ = true;
  }

  /// A node that is started again amid a lift finds no rest to learn from. The parameter server outlives it.
  void remember(const ResidualNoise& noise) {
    private_node_.setParam(
        kLearnedNoise, std::vector<double>{noise.white_n, noise.slow_n, noise.slow_time_s, noise.degrees_of_freedom});
  }
  void recall() {
    std::vector<double> values;
    if (!private_node_.getParam(kLearnedNoise, values) || values.size() != 4) return;
    settings_.noise = ResidualNoise{values[0], values[1], values[2], values[3]};
    residual_ = LiveResidual(settings_);
    ROS_INFO("noise taken over from before the restart: %.1f N white, %.1f N over %.1f s", values[0], values[1],
             values[2]);
  }

  void look() {
    for (const ResidualReport& report : residual_.take()) {
      publish(report);
      last_published_ = ros::WallTime::now();
    }
    if (!settings_.noise && residual_.noise()) {
      settings_.noise = residual_.noise();  // kept where a run follows
      remember(*residual_.noise());
    }
    const ros::WallTime now = ros::WallTime::now();
    if ((now - last_published_).toSec() < kSilenceS) return;
    last_published_ = now;
    publishWaiting(now);
  }

  void publishWaiting(ros::WallTime now) {
    ForceResidual message;
    message.header.stamp.fromSec(
        std::max(residual_.newestMeasured().value_or(0.0), residual_.newestSimulated().value_or(0.0)));
    fill(message, ResidualReport());
    message.measured_n = message.simulated_n = message.residual_n = std::numeric_limits<double>::quiet_NaN();
    message.state = "waiting";
    const auto silent = [&](ros::WallTime heard) { return (now - heard).toSec() > kSilenceS; };
    if (silent(measured_heard_) && !silent(simulated_heard_)) {
      message.text = "no messages on " + node_.resolveName(topics::kMeasuredWrench) +
                     ": outside of the record's time, or start replay_node, or remap it to the topic of the load cell";
    } else if (silent(simulated_heard_) && !silent(measured_heard_)) {
      message.text = "no messages on " + node_.resolveName(topics::kWrench) + ": start rig_node, or resume it";
    } else if (silent(simulated_heard_)) {
      message.text = "no messages on " + node_.resolveName(topics::kMeasuredWrench) + " nor on " +
                     node_.resolveName(topics::kWrench);
    } else {
      message.text = "both topics arrive, but not with the same stamps (measured up to " +
                     secondsText(residual_.newestMeasured()) + ", simulated up to " +
                     secondsText(residual_.newestSimulated()) + "): they need one clock";
    }
    publisher_.publish(message);
    ROS_WARN_THROTTLE(10.0, "%s", message.text.c_str());
  }

  static std::string secondsText(const std::optional<double>& stamp_s) {
    char text[32];
    std::snprintf(text, sizeof text, "%.2f s", stamp_s.value_or(0.0));
    return text;
  }

  void fill(ForceResidual& message, const ResidualReport& report) const {
    message.header.frame_id = frames::kLoadCell;
    message.measured_n = report.measured_n;
    message.simulated_n = report.simulated_n;
    message.residual_n = report.residual_n;
    message.expected_sigma_n = report.expected_sigma_n;
    message.whitened_ratio = report.whitened_ratio;
    message.rms_n = report.rms_n;
    message.window_bins = static_cast<std::uint32_t>(report.window.bins);
    message.window_chi2_ratio = report.window.chi2_ratio;
    message.window_chi2_p = report.window.chi2_p;
    message.window_ljung_box_p = report.window.ljung_box_p;
    message.test_bins = static_cast<std::uint32_t>(report.test.bins);
    message.test_chi2_ratio = report.test.chi2_ratio;
    message.test_chi2_p = report.test.chi2_p;
    message.test_ljung_box_p = report.test.ljung_box_p;
    message.significant = report.significant;
    message.significant_since_s = report.significant_since_s;
    const double unknown = std::numeric_limits<double>::quiet_NaN();
    const std::optional<ResidualNoise>& noise = residual_.noise();
    message.white_noise_n = noise ? noise->white_n : unknown;
    message.slow_noise_n = noise ? noise->slow_n : unknown;
    message.slow_noise_time_s = noise ? noise->slow_time_s : unknown;
    message.noise_estimated = !noise_given_;
    message.late_messages = static_cast<std::uint32_t>(residual_.lateSamples());
  }

  void publish(const ResidualReport& report) {
    ForceResidual message;
    message.header.stamp.fromSec(report.time_s);
    fill(message, report);
    char text[200];
    if (report.learning) {
      message.state = "learning";
      std::snprintf(text, sizeof text, "learning the noise, which takes %.3g s at rest", settings_.learn_s);
      message.text = text;
    } else if (report.significant) {
      message.state = "significant";
      message.text = "significant: run brash_ice identify on the record";
    } else {
      message.state = "not_significant";
      std::snprintf(text, sizeof text, "noise and an error of the model of %.3g %% of the force explain the difference",
                    100.0 * settings_.discrepancy_ratio);
      message.text = text;
    }
    if (moved_while_learning_) {
      message.text +=
          "; the hoist moved while the noise was learned, which makes it too large: give white_noise_n, or "
          "begin with a rest";
    }
    publisher_.publish(message);
    if (report.significant && !was_significant_) {
      ROS_WARN("%s (t = %.2f s, residual %.0f N, expected within %.0f N)", message.text.c_str(), report.time_s,
               report.residual_n, report.expected_sigma_n);
    }
    was_significant_ = report.significant;
  }

  ros::NodeHandle node_, private_node_;
  LiveResidualSettings settings_;
  bool noise_given_;
  LiveResidual residual_;
  bool was_significant_ = false;
  bool moved_while_learning_ = false;
  ros::WallTime measured_heard_, simulated_heard_, last_published_ = ros::WallTime::now();
  ros::Publisher publisher_;
  ros::Subscriber measured_subscriber_, simulated_subscriber_, crane_subscriber_;
  ros::ServiceServer restart_service_;
  ros::WallTimer timer_;
};

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  ros::init(argc, argv, "residual_node");
  try {
    brash_ice_rig::ResidualNode node;
    brash_ice_rig::fenceToLoopback();
    ros::spin();
    return 0;
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 2;
  }
}
