#pragma once

#include <chrono>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include "brash_ice_rig/SimStatus.h"
#include "brash_ice_rig/Step.h"
#include "brash_ice_rig/node/service_call.h"

// What the node's tests share. Waiting is by wall time throughout: ROS time is the thing under test.
namespace brash_ice_rig {

/// Handles callbacks until the condition holds. @return whether it came to hold in time
inline bool waitFor(const std::function<bool()>& condition, double timeout_s = 15.0) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
  while (ros::ok()) {
    ros::spinOnce();
    if (condition()) return true;
    if (std::chrono::steady_clock::now() > end) return false;
    ros::WallDuration(0.001).sleep();
  }
  return false;
}

inline void spinFor(double wall_s) {
  waitFor([] { return false; }, wall_s);
}

/// Keeps every message of a topic with the wall time of its arrival, s.
template <class Message>
class Listener {
 public:
  explicit Listener(const std::string& topic) {
    subscriber_ = node_.subscribe<Message>(topic, 10000, [this](const boost::shared_ptr<Message const>& message) {
      messages.push_back(*message);
      arrivals_s.push_back(ros::SteadyTime::now().toSec());
    });
  }

  /// Waits for a message that comes after this call and fulfils the condition.
  bool waitForNew(
      const std::function<bool(const Message&)>& condition = [](const Message&) { return true; },
      double timeout_s = 15.0) {
    std::size_t next = messages.size();
    return waitFor(
        [&] {
          while (next < messages.size()) {
            if (condition(messages[next++])) return true;
          }
          return false;
        },
        timeout_s);
  }

  /// Waits until nothing that is published from now on gets lost.
  bool waitForConnection() {
    if (!waitFor([this] { return subscriber_.getNumPublishers() > 0; })) return false;
    spinFor(0.3);  // the publisher takes the connection up a moment later
    return true;
  }

  /// @throws std::runtime_error before the first message, which gtest reports as a failure of the one test
  const Message& first() const { return at(0); }
  const Message& last() const { return at(messages.size() - 1); }

  std::vector<Message> messages;
  std::vector<double> arrivals_s;

 private:
  const Message& at(std::size_t index) const {
    if (messages.empty()) throw std::runtime_error("no message has come yet on " + subscriber_.getTopic());
    return messages[index];
  }

  ros::NodeHandle node_;
  ros::Subscriber subscriber_;
};

/// Calls a service as soon as a node offers it: one service after the other is offered.
template <class Service>
void callWhenOffered(const std::string& name, Service& service) {
  EXPECT_TRUE(ros::service::waitForService(name, 15000)) << name;
  EXPECT_TRUE(callService(name, service)) << name;
}

/// Calls one of the node's Trigger services; name relative to the test, e.g. "rig_node/pause".
inline std_srvs::Trigger::Response callTrigger(const std::string& name) {
  std_srvs::Trigger trigger;
  callWhenOffered(name, trigger);
  return trigger.response;
}

/// Runs a paused node on, e.g. with the service "rig_node/step".
inline Step::Response callStep(const std::string& name, double duration_s) {
  Step step;
  step.request.duration_s = duration_s;
  callWhenOffered(name, step);
  return step.response;
}

/// Position of a flag's bit in flag_names and remedies, or -1 if it is not raised.
inline int findFlag(const SimStatus& status, std::uint32_t flag) {
  if ((status.flags & flag) == 0) return -1;
  int index = 0;
  for (std::uint32_t bit = 1; bit < flag; bit <<= 1) index += (status.flags & bit) != 0 ? 1 : 0;
  return index;
}

inline bool hasFlag(const SimStatus& status, std::uint32_t flag) {
  return findFlag(status, flag) >= 0;
}

inline int runRosTest(int argc, char** argv, const char* name) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, name);
  ros::NodeHandle keep_ros_alive;
  return RUN_ALL_TESTS();
}

}  // namespace brash_ice_rig
