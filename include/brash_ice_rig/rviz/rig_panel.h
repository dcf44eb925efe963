#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>
#include <rviz/panel.h>

#include "brash_ice_rig/CraneState.h"
#include "brash_ice_rig/SimStatus.h"
#include "brash_ice_rig/rviz/force_history.h"
#include "brash_ice_rig/rviz/hand_drive.h"
#include "brash_ice_rig/rviz/service_caller.h"
#include "brash_ice_rig/teleop/command_publisher.h"

class QDoubleSpinBox;
class QGroupBox;
class QLabel;
class QLineEdit;
class QPushButton;
class QTextBrowser;

namespace brash_ice_rig {

class ForcePlot;
class SpringSlider;

/// The operator's panel in rviz: force over time, crane, collector, stages, run control, flags with their remedies.
/// Saved properties: Namespace (of the rig; empty: that of rviz), Full Speed (m/s), Step (s).
///
/// Everything happens in the GUI's thread, which serves ROS callbacks, too; only service calls and velocity commands
/// have their own: a frame of rviz may take longer than the crane's watchdog waits. Topics come back by themselves when
/// the node is restarted.
class RigPanel : public rviz::Panel {
 public:
  explicit RigPanel(QWidget* parent = nullptr);
  ~RigPanel() override;

  void load(const rviz::Config& config) override;
  void save(rviz::Config config) const override;

 private:
  using WallClock = std::chrono::steady_clock;
  struct RaisedFlag {
    std::string remedy;
    WallClock::time_point seen;
  };

  QWidget* makeCraneBox();
  QWidget* makeCollectorBox();
  QWidget* makeStageRow();
  QWidget* makeRunRow();
  QWidget* makeNamespaceRow();
  SpringSlider* makeSlider(HandDrive::Axis axis, Qt::Orientation orientation, const char* name);
  QPushButton* makeButton(const char* text, const char* name, const char* tip);

  /// Connects to the rig in the namespace that the field names, or says what is wrong with the name.
  void connectToRig();
  void onWrench(const geometry_msgs::WrenchStamped& wrench);
  void onStatus(const SimStatus& status);
  void onCrane(const CraneState& crane);

  /// What drive_ says now; under drive_mutex_.
  void sendVelocity();
  /// In a thread of its own: repeats the velocity while a slider is held, and lets go when the GUI stands still.
  void repeatVelocity();
  /// In the GUI: it goes on. After a standstill the sliders spring back, for the crane has been stopped.
  void showThatGuiRuns();
  void sendFold(double ratio);
  void trigger(const char* service);
  void pauseOrResume();
  void step();
  void reset();
  void runTo(std::size_t stage);
  void say(const std::string& text, bool trouble);

  void refresh();
  void showState(bool alive);
  void showForce();
  void showFlags();
  bool alive() const;

  ros::NodeHandle node_;
  std::array<ros::Subscriber, 3> subscribers_;
  ServiceCaller caller_;

  ForceHistory history_;
  std::optional<SimStatus> status_;
  std::optional<CraneState> crane_;
  WallClock::time_point status_seen_{};
  std::map<std::string, RaisedFlag> flags_;
  std::optional<std::size_t> run_to_;  ///< stage at whose beginning to pause

  std::mutex drive_mutex_;  ///< of what follows up to the blank line
  HandDrive drive_;
  CommandPublisher commands_;
  WallClock::time_point gui_seen_ = WallClock::now();
  bool ending_ = false;

  std::array<SpringSlider*, 3> sliders_;
  QLabel *head_, *force_, *crane_state_, *collector_state_, *answer_;
  ForcePlot* plot_;
  QGroupBox* crane_box_;
  QTextBrowser* flag_list_;
  QPushButton *pause_, *step_, *reset_, *tare_;
  std::array<QPushButton*, 6> stages_;
  QDoubleSpinBox *full_speed_, *step_duration_;
  QLineEdit* namespace_;

  std::condition_variable ending_now_;
  std::thread repeater_;
};

}  // namespace brash_ice_rig
