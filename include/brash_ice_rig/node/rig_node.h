#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/TwistStamped.h>
#include <ros/ros.h>
#include <std_msgs/Float64.h>
#include <std_srvs/Trigger.h>

#include "brash_ice_rig/Checkpoint.h"
#include "brash_ice_rig/Step.h"
#include "brash_ice_rig/node/message_conversion.h"
#include "brash_ice_rig/node/node_options.h"
#include "brash_ice_rig/node/pull_up_server.h"
#include "brash_ice_rig/node/real_time_pacer.h"
#include "brash_ice_rig/node/reconfigure_server.h"
#include "brash_ice_rig/node/scenario_request.h"
#include "brash_ice_rig/output/run_files.h"
#include "brash_ice_rig/output/run_summary.h"
#include "brash_ice_rig/simulation/simulation.h"

namespace brash_ice_rig {

/// The rig as a ROS node: topics and services of doc/ros_api.md around one Simulation.
///
/// Threads: the one in run() owns the simulation, publishes and paces by the steady clock; it never waits on ROS time,
/// which it makes itself. ROS callbacks run elsewhere: live commands go through the simulation's thread-safe setters,
/// services through a queue that run() serves between two samples, and they answer when the thing is done.
class RigNode {
 public:
  /// @throws ConfigError on a bad scenario, OutputError if the output directory cannot be written
  RigNode(const NodeOptions& options, const ros::NodeHandle& node, const ros::NodeHandle& private_node);
  ~RigNode();

  /// Simulates until ROS shuts down, or the script's end with exit_at_end. Writes what is still to be written.
  /// @return 0, or 1 if the world froze or files could not be written
  int run();

 private:
  using WallClock = std::chrono::steady_clock;

  struct Answer {
    bool success;
    std::string message;
  };
  struct Request {
    std::function<Answer()> work;
    std::promise<Answer> answer;
  };

  // Callback threads.
  void onCraneCommand(const ros::MessageEvent<geometry_msgs::TwistStamped const>& event);
  /// Nodes that have sent a velocity command within the last second. Counting those that are merely connected would
  /// lock the crane for a silent panel, or for a driver that crashed and that ROS still lists.
  /// @param speaker  name of the node that sends one now, or empty
  std::size_t countCommanders(const std::string& speaker = "");
  void onFoldCommand(const ros::MessageEvent<std_msgs::Float64 const>& event);
  Answer ask(std::function<Answer()> work);
  Answer tare();
  /// Asks for another world, which has other settings.
  Answer askForWorld(std::function<Answer()> work);
  ReconfigureServer::Rig rigForReconfigure();
  void advertiseLoadScenario();
  /// Runs `work` on a file that a service named, or says why the name is refused.
  Answer onCheckpointFile(const std::string& name, const std::function<Answer(const std::string& path)>& work);
  Answer saveCheckpoint(const std::string& path);
  void advertiseCheckpoint(const char* name, std::function<Answer(const std::string& path)> work);
  PullUpServer::Rig rigForPullUp();
  void advertiseTrigger(ros::NodeHandle& node, const char* name, std::function<Answer()> work);

  // Simulation thread.
  void simulateUntilEnd();
  void serveRequests();
  void refuseRequests();
  Answer pause();
  Answer resume();
  Answer reset();
  Answer step(double duration_s);
  Answer loadCheckpoint(const std::string& path);
  Answer loadScenarioFor(const LoadScenarioRequest& request);
  void adoptScenario();
  LiveSettings liveSettings() const;
  void changeLiveSettings(const LiveSettings& wanted);
  /// What others learn of the scenario once.
  void publishScenario();
  Answer replaceWorld(std::unique_ptr<Simulation> world, CheckpointReader* resumed, std::string message);
  CheckpointWriter makeCheckpoint(const std::string& path);
  void autosave(const Snapshot& snapshot);
  void scheduleAutosave();
  void finishAutosave();
  void reportAutosave(const std::exception& error);
  /// @param resumed  where the simulation was loaded from
  void startRun(CheckpointReader* resumed = nullptr);
  void finishRun(bool interrupted);
  void advance(std::uint64_t steps);
  std::uint64_t stepsToNextSample() const;
  /// Why the action pull_up cannot begin now; empty: it can.
  std::string reasonAgainstPullUp() const;
  /// The test has an end of its own.
  bool hasEnd() const {
    return scenario_.procedure.control == ControlMode::kScripted || !scenario_.procedure.commands_file.empty();
  }
  bool idle() const { return paused_ || simulation_->frozen(); }

  Stamp stamp(double time_s) const;
  /// Tells recorders that a run begins at the present state.
  void publishRunStart();
  void publishCommands(const std::vector<RigCommand>& commands);
  void publishSample(const Snapshot& snapshot);
  void publishIdleFrame();
  void publishClock(const Stamp& now);
  void publishJoints(const Stamp& now, const Snapshot& snapshot);
  void publishStates(const Stamp& now, const Snapshot& snapshot);
  void publishPoints(const Stamp& now);
  void publishMarkers(const Stamp& now, const Snapshot& snapshot);
  void publishStatus(WallClock::time_point now);
  void publishDiagnostics(WallClock::time_point now);
  void printProgress(const Snapshot& snapshot);
  void warnAboutForeignClock() const;
  void addDiagnostics();

  NodeOptions options_;
  Scenario scenario_;

  std::mutex simulation_mutex_;  ///< held while simulation_ is replaced, and by the setters' callers
  std::unique_ptr<Simulation> simulation_;
  std::uint64_t steps_per_sample_ = 1;

  std::mutex commanders_mutex_;
  std::map<std::string, WallClock::time_point> commanders_;  ///< node name -> when it was heard last

  std::mutex request_mutex_;
  std::condition_variable request_arrived_;
  std::deque<Request> requests_;
  bool closed_ = false;

  RealTimePacer pacer_;
  bool paused_;
  bool script_done_ = false;
  bool failed_ = false;
  double clock_offset_s_ =
      0.0;  ///< ROS time of the test's time 0; grows with each reset, so that ROS time never rewinds
  std::uint64_t sample_index_ = 0;
  std::int64_t printed_second_ = 0;

  std::optional<RunFiles> files_;  ///< empty without ~output_dir and after the run's end
  std::optional<ForceStatistics> statistics_;
  int run_number_ = 0;
  std::uint32_t command_index_ = 0;  ///< of the last command published in this run
  double compute_s_ = 0.0;           ///< wall time in the simulation since the run's start
  std::future<void> plot_;

  std::mutex commit_mutex_;   ///< one checkpoint is written at a time
  std::future<void> saving_;  ///< the autosave on its way to the disk
  double autosave_due_s_ = 0.0;

  StatusFlags raised_;                        ///< since the last status message
  StatusFlags raised_since_sample_;           ///< since the last sample, for the action
  std::atomic<bool> command_refused_{false};  ///< by the node: bad frame; moves into raised_
  WallClock::time_point next_status_{};
  WallClock::time_point next_overload_log_{};
  WallClock::time_point last_diagnostics_{};
  double sample_rate_hz_ = 0.0;  ///< load-cell samples per wall s between the last two diagnostics
  std::uint64_t samples_since_diagnostics_ = 0;
  SimStatus status_;  ///< the last one published

  ros::NodeHandle node_, private_node_;
  ros::Publisher clock_publisher_, wrench_publisher_, true_wrench_publisher_, components_publisher_, points_publisher_,
      plug_publisher_, command_out_publisher_, crane_publisher_, status_publisher_, scenario_publisher_,
      motion_file_publisher_, commands_publisher_, joints_publisher_, markers_publisher_;
  diagnostic_updater::Updater diagnostics_;
  ros::Subscriber crane_subscriber_, fold_subscriber_;
  std::vector<ros::ServiceServer> services_;
  std::optional<PullUpServer> pull_up_;
  std::optional<ReconfigureServer> reconfigure_;
};

}  // namespace brash_ice_rig
