#pragma once

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <ros/service.h>

#include "brash_ice_rig/node/service_call.h"

namespace brash_ice_rig {

/// Calls services of the rig, one at a time, without making the caller wait. Each is looked up when it is called, so
/// that a node that was restarted in between is found. Not for several threads.
class ServiceCaller {
 public:
  struct Answer {
    std::string service;
    bool success;
    std::string message;
  };

  /// @param service  type with success and message in its response, its request filled in
  /// @param name     resolved name
  /// @param timeout_s  after that long poll() gives up; the call itself cannot be ended
  /// @return false if another call is under way
  template <class Service>
  bool call(const std::string& name, Service service, double timeout_s) {
    if (pending_) return false;
    pending_ = std::make_shared<Pending>();
    name_ = name;
    deadline_ = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(timeout_s));
    // Detached and with its own share of the state: roscpp waits for an answer as long as the node lives, and neither a
    // click nor the end of the panel may wait with it.
    std::thread([pending = pending_, name, service]() mutable {
      Answer answer{name, false, "there is no such service; is the rig running?"};
      if (ros::service::exists(name, false)) {
        const bool answered = callService(name, service);
        answer.success = answered && service.response.success;
        answer.message = answered ? service.response.message : "the node went away before it answered";
      }
      const std::lock_guard<std::mutex> lock(pending->mutex);
      pending->answer = answer;
    }).detach();
    return true;
  }

  bool busy() const { return pending_ != nullptr; }

  /// The answer to the last call, once.
  std::optional<Answer> poll() {
    if (!pending_) return std::nullopt;
    std::optional<Answer> answer;
    {
      const std::lock_guard<std::mutex> lock(pending_->mutex);
      answer = pending_->answer;
    }
    if (!answer && Clock::now() > deadline_) answer = Answer{name_, false, "no answer; the node does not respond"};
    if (answer) pending_.reset();
    return answer;
  }

 private:
  using Clock = std::chrono::steady_clock;
  struct Pending {
    std::mutex mutex;
    std::optional<Answer> answer;
  };

  std::shared_ptr<Pending> pending_;
  std::string name_;
  Clock::time_point deadline_;
};

}  // namespace brash_ice_rig
