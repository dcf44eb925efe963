#include "brash_ice_rig/node/master_watch.h"

#include <map>
#include <utility>

#include <ros/network.h>
#include <xmlrpcpp/XmlRpcClient.h>

namespace brash_ice_rig {
namespace {

constexpr double kIntervalS = 2.0;

/// Asks the master, without waiting for one that is away. @return whether it answered and said yes
bool ask(const std::string& method, const std::vector<std::string>& arguments, XmlRpc::XmlRpcValue& payload) {
  XmlRpc::XmlRpcValue request, response;
  request[0] = ros::this_node::getName();
  for (std::size_t i = 0; i < arguments.size(); ++i) request[static_cast<int>(i) + 1] = arguments[i];
  return ros::master::execute(method, request, response, payload, false);
}

/// Of one third of getSystemState: the names behind which this node stands.
std::vector<std::string> namesOfThisNode(XmlRpc::XmlRpcValue& part) {
  std::vector<std::string> names;
  for (int i = 0; i < part.size(); ++i) {
    for (int k = 0; k < part[i][1].size(); ++k) {
      if (static_cast<std::string>(part[i][1][k]) != ros::this_node::getName()) continue;
      names.push_back(static_cast<std::string>(part[i][0]));
    }
  }
  return names;
}

/// What a master says to a subscriber when publishers come, said to this node by itself.
void tellPublishers(const std::string& own_uri, const std::string& topic, const XmlRpc::XmlRpcValue& publishers) {
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(own_uri, host, port)) return;
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue request, response;
  request[0] = "/master";
  request[1] = topic;
  request[2] = publishers;
  client.execute("publisherUpdate", request, response);
}

}  // namespace

MasterWatch::MasterWatch(ros::NodeHandle& node, std::vector<std::string> parameters)
    : parameters_(std::move(parameters)) {
  look();  // what is lost within the next two seconds could not be told any more
  timer_ = node.createWallTimer(ros::WallDuration(kIntervalS), [this](const ros::WallTimerEvent&) { look(); });
}

void MasterWatch::look() {
  XmlRpc::XmlRpcValue uri;
  if (ask("lookupNode", {ros::this_node::getName()}, uri)) {
    own_uri_ = static_cast<std::string>(uri);
    if (lost_) ROS_WARN("the ROS master answers again");
    lost_ = false;
    remember();
    return;
  }
  if (!ros::master::check()) {
    if (!lost_) {
      ROS_ERROR(
          "the ROS master does not answer any more: the simulation goes on, and so do connections that stand, but "
          "nobody new finds this node until a master is back");
    }
    lost_ = true;
    return;
  }
  if (own_uri_.empty()) return;  // it has never known us: we are just coming up
  registerAnew();
  lost_ = false;
}

void MasterWatch::remember() {
  XmlRpc::XmlRpcValue state, types;
  if (!ask("getSystemState", {}, state) || !ask("getTopicTypes", {}, types)) return;
  std::map<std::string, std::string> type_of;
  for (int i = 0; i < types.size(); ++i) {
    type_of[static_cast<std::string>(types[i][0])] = static_cast<std::string>(types[i][1]);
  }
  const auto withTypes = [&](XmlRpc::XmlRpcValue& part) {
    std::vector<Registration> registrations;
    for (const std::string& name : namesOfThisNode(part)) registrations.push_back({name, type_of[name]});
    return registrations;
  };
  published_ = withTypes(state[0]);
  subscribed_ = withTypes(state[1]);
  services_.clear();
  for (const std::string& name : namesOfThisNode(state[2])) {
    XmlRpc::XmlRpcValue uri;
    if (ask("lookupService", {name}, uri)) services_.push_back({name, static_cast<std::string>(uri)});
  }
  values_.clear();
  for (const std::string& name : parameters_) {
    XmlRpc::XmlRpcValue value;
    if (ask("getParam", {name}, value)) values_.emplace_back(name, value);
  }
}

void MasterWatch::registerAnew() {
  XmlRpc::XmlRpcValue payload;
  for (const auto& [name, value] : values_) {
    if (ask("getParam", {name}, payload)) continue;
    XmlRpc::XmlRpcValue request, response;
    request[0] = ros::this_node::getName();
    request[1] = name;
    request[2] = value;
    ros::master::execute("setParam", request, response, payload, false);
  }
  for (const Registration& topic : published_) ask("registerPublisher", {topic.name, topic.what, own_uri_}, payload);
  for (const Registration& service : services_) ask("registerService", {service.name, service.what, own_uri_}, payload);
  for (const Registration& topic : subscribed_) {
    const std::string type = topic.what.empty() ? "*" : topic.what;
    if (ask("registerSubscriber", {topic.name, type, own_uri_}, payload)) tellPublishers(own_uri_, topic.name, payload);
  }
  ROS_WARN(
      "another ROS master has taken the place of the one that knew this node: the node has registered with it anew; "
      "other nodes have to be restarted");
}

}  // namespace brash_ice_rig
