#pragma once

#include <cstddef>
#include <limits>
#include <string>

#include "brash_ice_rig/system/descriptor.h"

namespace brash_ice_rig {

/// A file that somebody has named, read from its beginning to its end. It never keeps its reader waiting: pipes and
/// devices are refused, and so are the kernel's files that wait for something to happen, such as /proc/kmsg.
class InputFile {
 public:
  /// @throws ConfigError naming the file, here and in read()
  explicit InputFile(const std::string& path);

  /// @return how many bytes were read, at most `size`; 0 at the end of the file only
  std::size_t read(char* data, std::size_t size);
  /// What is left of the file, at most `most` bytes.
  std::string read(std::size_t most = std::numeric_limits<std::size_t>::max());

 private:
  std::string path_;
  Descriptor file_;
};

/// Whether a file can be read and begins with some bytes.
bool fileBeginsWith(const std::string& path, const std::string& bytes);

}  // namespace brash_ice_rig
