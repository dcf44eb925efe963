#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include <actionlib/server/action_server.h>
#include <ros/ros.h>

#include "brash_ice_rig/PullUpAction.h"
#include "brash_ice_rig/config/scenario.h"
#include "brash_ice_rig/output/run_summary.h"
#include "brash_ice_rig/rig/pull_up_sequence.h"
#include "brash_ice_rig/simulation/snapshot.h"

namespace brash_ice_rig {

/// The action pull_up: takes one goal at a time, drives it with a PullUpSequence, and stops the crane whenever the goal
/// ends, be it done, failed, canceled, given up by its client, or overruled. Any thread may call it.
class PullUpServer {
 public:
  /// What the server needs of the node. Both are called by any thread.
  struct Rig {
    /// Has work done between two samples and waits for it; does nothing while the node shuts down. The work is told
    /// why the rig cannot take a goal; empty: it can.
    std::function<void(const std::function<void(const Snapshot&, const std::string& refusal)>& work)> between_samples;
    /// Commands of manual control: hoist speed, > 0 up, and a new fold target, if any.
    std::function<void(double hoist_speed_mps, std::optional<double> fold_target)> command;
  };

  /// @param feedback_rate_hz  per simulated s. A connection that is dead is noticed when something is sent over it.
  PullUpServer(const ros::NodeHandle& node, const Scenario& scenario, double feedback_rate_hz, Rig rig);

  /// After each sample of the load cell.
  /// @param raised  flags of the time since the sample before
  void update(const Snapshot& snapshot, StatusFlags raised);

  /// Ends the goal, if there is one, and stops the crane.
  /// @param reason  becomes part of the result's message
  void abort(const std::string& reason);

  /// Ends the goal, if there is one, and leaves the crane to whoever has just sent a command.
  /// @param commander  name of that node
  void giveWayTo(const std::string& commander);

  /// The rig is another one from now on. Abort the goal first.
  void useScenario(const Scenario& scenario);

  /// A goal is running.
  bool busy();

  /// Tells clients that the server lives. actionlib does so by ROS time, which stands in a pause.
  void publishStatus() { server_.publishStatus(); }

 private:
  class Server : public actionlib::ActionServer<PullUpAction> {
   public:
    using ActionServer::ActionServer;
    using actionlib::ActionServerBase<PullUpAction>::publishStatus;
  };
  using GoalHandle = Server::GoalHandle;

  enum class End { kSucceeded, kAborted, kCanceled };
  struct Run {
    GoalHandle goal;
    PullUpSequence sequence;
    ForceStatistics statistics;
    double start_s;  ///< time of the test when the goal was accepted
    double time_s;   ///< of the last sample
    double next_feedback_s;
  };

  void onGoal(GoalHandle goal);
  void onCancel(const GoalHandle& goal);
  void onListenerLost(const std::string& listener);
  void start(GoalHandle& goal, const Snapshot& snapshot, const std::string& refusal);
  // Of the goal that runs; the mutex is held.
  void publishFeedback(const Snapshot& snapshot);
  PullUpResult makeResult(bool success, const std::string& message) const;
  void end(End how, const std::string& text);
  void stopAndEnd(End how, const std::string& reason);
  const std::string& sender();  ///< node that sent it, empty if unknown

  const double feedback_period_s_;
  const Rig rig_;

  std::mutex mutex_;  ///< of all below
  Scenario scenario_;
  std::optional<Run> run_;
  std::map<std::string, std::string> senders_;  ///< of goals: goal id -> node
  std::set<std::string> listeners_;             ///< nodes that subscribe to the feedback

  ros::NodeHandle node_;
  ros::Subscriber sender_subscriber_;
  ros::Publisher listener_publisher_;
  Server server_;
};

}  // namespace brash_ice_rig
