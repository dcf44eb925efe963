#pragma once

#include <string>

namespace brash_ice_rig {

/// Keeps a second program out of a directory of results. The system lets go of it when this process and its children
/// have ended.
class DirectoryLock {
 public:
  /// @throws std::runtime_error if another program is at work there  @throws OutputError if the lock cannot be made
  explicit DirectoryLock(const std::string& directory);
  ~DirectoryLock();
  DirectoryLock(const DirectoryLock&) = delete;
  DirectoryLock& operator=(const DirectoryLock&) = delete;

 private:
  int number_;
};

}  // namespace brash_ice_rig
