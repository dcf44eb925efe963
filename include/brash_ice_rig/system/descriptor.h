#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <string>
#include <utility>

namespace brash_ice_rig {

/// A file descriptor that is closed in any case. Programs that are started do not get it.
class Descriptor {
 public:
  /// @param flags  of open(); errno tells why it is not good()
  Descriptor(const std::string& path, int flags) : number_(open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
  ~Descriptor() { close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  bool good() const { return number_ >= 0; }
  int number() const { return number_; }
  /// @return whether all that was written has reached the file
  bool close() {
    const int number = std::exchange(number_, -1);
    return number < 0 || ::close(number) == 0;
  }

 private:
  int number_;
};

}  // namespace brash_ice_rig
