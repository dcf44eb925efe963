#include "brash_ice_rig/system/available_memory.h"

#include <sys/resource.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <sstream>

namespace brash_ice_rig {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The number behind a name in a file such as meminfo, or @param otherwise.
double valueOf(const std::string& path, const std::string& name, double otherwise) {
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string first;
    double value = 0.0;
    if (words >> first >> value && first == name) return value;
  }
  return otherwise;
}

/// The number that is all of a file; "max" and no file are no limit.
double onlyValue(const std::string& path, double otherwise) {
  std::ifstream in(path);
  double value = 0.0;
  return in >> value ? value : otherwise;
}

/// What is left of a group's limit. Files that the kernel keeps to spare the disk count as used, but can be had.
double leftInGroup(const std::string& directory, const char* limit, const char* used, const char* cache) {
  const double most = onlyValue(directory + limit, kInfinity);
  const double taken = onlyValue(directory + used, 0.0) - valueOf(directory + "/memory.stat", cache, 0.0);
  return most - std::max(taken, 0.0);
}

/// The least that is left in the groups of this process, each of which has its parents' limits, too.
double leftInGroups(const std::string& root) {
  const std::string groups = root + "/sys/fs/cgroup", memory_groups = groups + "/memory";
  double left = kInfinity;
  std::ifstream in(root + "/proc/self/cgroup");
  for (std::string line; std::getline(in, line);) {
    // number:controllers:path; the second version has one line without controllers.
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const bool unified = controllers == ",,";
    if (!unified && controllers.find(",memory,") == std::string::npos) continue;
    for (std::string path = line.substr(second + 1);; path.erase(path.rfind('/'))) {
      if (path == "/") path.clear();
      left = std::min(left, unified ? leftInGroup(groups + path, "/memory.max", "/memory.current", "inactive_file")
                                    : leftInGroup(memory_groups + path, "/memory.limit_in_bytes",
                                                  "/memory.usage_in_bytes", "total_inactive_file"));
      if (path.find('/') == std::string::npos) break;
    }
  }
  return left;
}

/// What is left of the limit on the address space.
double leftInAddressSpace(const std::string& root) {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kInfinity;
  constexpr double kKibibyte = 1024.0;
  return static_cast<double>(limit.rlim_cur) - kKibibyte * valueOf(root + "/proc/self/status", "VmSize:", 0.0);
}

}  // namespace

double availableMemory(const std::string& root) {
  constexpr double kKibibyte = 1024.0;
  const double free = kKibibyte * valueOf(root + "/proc/meminfo", "MemAvailable:", kInfinity);
  return std::max(0.0, std::min({free, leftInGroups(root), leftInAddressSpace(root)}));
}

}  // namespace brash_ice_rig
