#pragma once

#include <string>

#include <ros/service.h>

namespace brash_ice_rig {

/// Calls a service once, and waits for its answer as long as the node lives.
/// Not ros::service::call(): there the server closes the connection, and a caller that has to wait for a processor may
/// see it closed before the answer and lose it (ros_comm issue 1976). A persistent connection is closed by the caller.
/// @param name  resolved against the caller's namespace
/// @return false if there is no such service or its node went away
template <class Service>
bool callService(const std::string& name, Service& service) {
  return ros::service::createClient<Service>(name, true).call(service);
}

}  // namespace brash_ice_rig
