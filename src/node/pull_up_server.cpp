#include "brash_ice_rig/node/pull_up_server.h"

#include <cstdio>
#include <limits>
#include <utility>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/node/topic_names.h"

namespace brash_ice_rig {
namespace {

/// Simulated time in which the sender of a goal must have subscribed to the feedback.
constexpr double kListenWithinS = 1.0;

PullUpOrder toOrder(const PullUpGoal& goal) {
  PullUpOrder order;
  order.fold_before_lowering = goal.fold_before_lowering;
  order.depth_m = goal.depth_m;
  order.lower_speed_mps = goal.lower_speed_mps;
  order.unfold_before_lifting = goal.unfold_before_lifting;
  order.lift_speed_mps = goal.lift_speed_mps;
  order.lift_height_m = goal.lift_height_m;
  order.lift_duration_s = goal.lift_duration_s;
  order.hold_duration_s = goal.hold_duration_s;
  return order;
}

/// Of a goal that was never accepted.
PullUpResult makeEmptyResult(const std::string& message) {
  PullUpResult result;
  result.message = message;
  result.peak_force_n = result.peak_time_s = result.residual_force_n = std::numeric_limits<double>::quiet_NaN();
  return result;
}

}  // namespace

PullUpServer::PullUpServer(const ros::NodeHandle& node, const Scenario& scenario, double feedback_rate_hz, Rig rig)
    : feedback_period_s_(1.0 / feedback_rate_hz),
      rig_(std::move(rig)),
      scenario_(scenario),
      node_(node, topics::kPullUp),
      server_(
          node, topics::kPullUp, [this](GoalHandle goal) { onGoal(std::move(goal)); },
          [this](const GoalHandle& goal) { onCancel(goal); }, false) {
  // actionlib tells neither who has sent a goal nor whether that node is still there. A second subscription and a
  // second advertisement beside its own do.
  using GoalEvent = ros::MessageEvent<PullUpActionGoal const>;
  sender_subscriber_ =
      node_.subscribe<PullUpActionGoal>("goal", 10, boost::function<void(const GoalEvent&)>([this](const GoalEvent& e) {
                                          const std::lock_guard<std::mutex> lock(mutex_);
                                          senders_[e.getConstMessage()->goal_id.id] = e.getPublisherName();
                                        }));
  listener_publisher_ = node_.advertise<PullUpActionFeedback>(
      "feedback", 50,
      [this](const ros::SingleSubscriberPublisher& listener) {
        const std::lock_guard<std::mutex> lock(mutex_);
        listeners_.insert(listener.getSubscriberName());
      },
      [this](const ros::SingleSubscriberPublisher& listener) { onListenerLost(listener.getSubscriberName()); });
  server_.start();
}

void PullUpServer::useScenario(const Scenario& scenario) {
  const std::lock_guard<std::mutex> lock(mutex_);
  scenario_ = scenario;
}

bool PullUpServer::busy() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return run_.has_value();
}

void PullUpServer::onGoal(GoalHandle goal) {
  bool answered = false;
  rig_.between_samples([&](const Snapshot& snapshot, const std::string& refusal) {
    start(goal, snapshot, refusal);
    answered = true;
  });
  if (!answered) goal.setRejected(makeEmptyResult("the node is shutting down"), "the node is shutting down");
}

void PullUpServer::start(GoalHandle& goal, const Snapshot& snapshot, const std::string& refusal) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const PullUpOrder order = toOrder(*goal.getGoal());
  std::string reason = refusal;
  if (reason.empty() && run_) reason = "another goal is running; cancel it first";
  if (reason.empty()) {
    try {
      checkPullUpOrder(order, scenario_, snapshot.rig.crane_hub_height_m);
    } catch (const ConfigError& error) {
      reason = error.what();
    }
  }
  if (!reason.empty()) {
    goal.setRejected(makeEmptyResult(reason), reason);
    senders_.erase(goal.getGoalID().id);
    ROS_WARN("%s: goal rejected: %s", topics::kPullUp, reason.c_str());
    return;
  }
  if (goal.getGoalStatus().status == actionlib_msgs::GoalStatus::RECALLING) {
    goal.setCanceled(makeEmptyResult("canceled before it began"), "canceled before it began");
    return;
  }
  goal.setAccepted();
  const double sample_period_s = 1.0 / scenario_.load_cell.rate_hz;
  run_.emplace(Run{goal, PullUpSequence(order, scenario_.crane, sample_period_s), ForceStatistics(sample_period_s),
                   snapshot.time_s, snapshot.time_s, snapshot.time_s});
}

void PullUpServer::update(const Snapshot& snapshot, StatusFlags raised) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!run_) return;
  run_->time_s = snapshot.time_s;
  // A goal that nobody looks after would drive on unattended.
  if (run_->time_s - run_->start_s > kListenWithinS && listeners_.count(sender()) == 0) {
    stopAndEnd(End::kAborted, "its sender " + (sender().empty() ? "(name unknown)" : sender()) +
                                  " does not listen to " + topics::kPullUp + "/feedback");
    return;
  }
  const double half_sample = 0.5 / scenario_.load_cell.rate_hz;
  if (snapshot.time_s > -half_sample) run_->statistics.add(snapshot.time_s, snapshot.force_n);
  const PullUpSequence::Drive drive = run_->sequence.step(snapshot, raised);
  rig_.command(drive.hoist_speed_mps, drive.fold_target);
  if (!run_->sequence.finished()) {
    if (snapshot.time_s > run_->next_feedback_s - half_sample) {
      publishFeedback(snapshot);
      run_->next_feedback_s += feedback_period_s_;
    }
    return;
  }
  if (run_->sequence.stage() == PullUpStage::kDone) {
    char text[120];
    std::snprintf(text, sizeof text, "done; the hub hangs at %+.3f m, the crane stands", snapshot.rig.hoist_position_m);
    end(End::kSucceeded, text);
  } else {
    end(End::kAborted, run_->sequence.failure());
  }
}

void PullUpServer::publishFeedback(const Snapshot& snapshot) {
  PullUpFeedback feedback;
  feedback.stage = pullUpStageName(run_->sequence.stage());
  feedback.time_s = snapshot.time_s;
  feedback.force_n = snapshot.force_n;
  feedback.hoist_position_m = snapshot.rig.hoist_position_m;
  feedback.hoist_speed_mps = snapshot.rig.crane_velocity_mps.z();
  feedback.fold_ratio = snapshot.rig.fold_ratio;
  run_->goal.publishFeedback(feedback);
}

PullUpResult PullUpServer::makeResult(bool success, const std::string& message) const {
  PullUpResult result = makeEmptyResult(message);
  result.success = success;
  result.duration_s = run_->time_s - run_->start_s;
  if (run_->statistics.empty()) return result;
  result.peak_force_n = run_->statistics.peak();
  result.peak_time_s = run_->statistics.peakTime();
  result.residual_force_n = run_->statistics.residual();
  return result;
}

// ------------------------------------------------------------------------------------------------ how a goal may end

void PullUpServer::end(End how, const std::string& text) {
  const PullUpResult result = makeResult(how == End::kSucceeded, text);
  if (how == End::kSucceeded) {
    run_->goal.setSucceeded(result, text);
  } else if (how == End::kCanceled) {
    run_->goal.setCanceled(result, text);
  } else {
    ROS_WARN("%s: %s", topics::kPullUp, text.c_str());
    run_->goal.setAborted(result, text);
  }
  senders_.erase(run_->goal.getGoalID().id);
  run_.reset();
}

void PullUpServer::stopAndEnd(End how, const std::string& reason) {
  rig_.command(0.0, {});
  end(how, reason + ", in stage " + pullUpStageName(run_->sequence.stage()) + "; the crane brakes to a stop");
}

void PullUpServer::onCancel(const GoalHandle& goal) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (run_ && run_->goal == goal) stopAndEnd(End::kCanceled, "canceled");
}

void PullUpServer::abort(const std::string& reason) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (run_) stopAndEnd(End::kAborted, reason);
}

void PullUpServer::giveWayTo(const std::string& commander) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!run_) return;
  end(End::kAborted,
      commander + " took over with a command of its own, in stage " + pullUpStageName(run_->sequence.stage()));
}

void PullUpServer::onListenerLost(const std::string& listener) {
  const std::lock_guard<std::mutex> lock(mutex_);
  listeners_.erase(listener);
  if (run_ && sender() == listener) stopAndEnd(End::kAborted, "the client " + listener + " is gone");
}

const std::string& PullUpServer::sender() {
  return senders_[run_->goal.getGoalID().id];
}

}  // namespace brash_ice_rig
