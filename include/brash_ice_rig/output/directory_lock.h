#pragma once

#include <functional>
#include <string>

namespace brash_ice_rig {

/// Keeps a second program out of a directory of results, or lets in those only that do the same. The system lets go of
/// it when this process and its children have ended.
class DirectoryLock {
 public:
  /// For one program alone.
  /// @throws std::runtime_error if another program is at work there  @throws OutputError if the lock cannot be made
  explicit DirectoryLock(const std::string& directory);

  /// For all programs that have the same work to do, on any computer.
  /// @param work   words for what is to be done, the same for all
  /// @param first  done before any other program is let in, unless another one is at work already
  /// @throws std::runtime_error if a program is at work there that does not share, or on something else
  /// @throws OutputError if the lock cannot be made
  DirectoryLock(const std::string& directory, const std::string& work, const std::function<void()>& first);

  ~DirectoryLock();
  DirectoryLock(const DirectoryLock&) = delete;
  DirectoryLock& operator=(const DirectoryLock&) = delete;

 private:
  int number_;
};

}  // namespace brash_ice_rig
