#include "brash_ice_rig/node/loopback.h"

#include <dirent.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include <ros/network.h>
#include <ros/ros.h>
#include <ros/xmlrpc_manager.h>

namespace brash_ice_rig {
namespace {

/// As roscpp decides for its other sockets.
bool isForThisComputerOnly() {
  for (const char* name : {"ROS_HOSTNAME", "ROS_IP"}) {
    const char* value = std::getenv(name);
    if (value == nullptr || *value == '\0') continue;
    return std::strcmp(value, "localhost") == 0 || std::strncmp(value, "127.", 4) == 0 ||
           std::strcmp(value, "::1") == 0;
  }
  return false;
}

std::vector<int> openDescriptors() {
  std::vector<int> descriptors;
  DIR* directory = opendir("/proc/self/fd");
  if (directory == nullptr) return descriptors;
  while (const dirent* entry = readdir(directory)) {
    if (entry->d_name[0] != '.') descriptors.push_back(std::atoi(entry->d_name));
  }
  closedir(directory);
  return descriptors;
}

/// Port on which a descriptor listens for TCP connections; 0: it does not.
unsigned listeningPort(int descriptor) {
  int listens = 0;
  socklen_t size = sizeof listens;
  if (getsockopt(descriptor, SOL_SOCKET, SO_ACCEPTCONN, &listens, &size) != 0 || listens == 0) return 0;
  sockaddr_storage address{};
  size = sizeof address;
  if (getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size) != 0) return 0;
  if (address.ss_family == AF_INET) return ntohs(reinterpret_cast<const sockaddr_in&>(address).sin_port);
  if (address.ss_family == AF_INET6) return ntohs(reinterpret_cast<const sockaddr_in6&>(address).sin6_port);
  return 0;
}

}  // namespace

bool fenceToLoopback() {
  if (!isForThisComputerOnly()) return false;
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(ros::XMLRPCManager::instance()->getServerURI(), host, port)) return false;
  for (const int descriptor : openDescriptors()) {
    if (listeningPort(descriptor) != port) continue;
    constexpr char kLoopback[] = "lo";
    if (setsockopt(descriptor, SOL_SOCKET, SO_BINDTODEVICE, kLoopback, sizeof kLoopback) == 0) return true;
    ROS_WARN("the XML-RPC port %u can be reached from other computers, who may end this node: %s", port,
             std::strerror(errno));
  }
  return false;
}

}  // namespace brash_ice_rig
