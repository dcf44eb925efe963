#pragma once

#include <string>

namespace brash_ice_rig {

/// Memory that this process can have without swapping, bytes: what the machine has free, and no more than is left of
/// the limits on the process (`ulimit -v`) and on its control groups (a container's, a batch system's). Infinity where
/// the system does not tell.
/// @param root  of the file system; tests have their own
double availableMemory(const std::string& root = "");

}  // namespace brash_ice_rig
