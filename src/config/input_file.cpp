#include "brash_ice_rig/config/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "brash_ice_rig/config/config_error.h"

namespace brash_ice_rig {
namespace {

[[noreturn]] void refuse(const std::string& path) {
  throw ConfigError("", "", std::string("file cannot be read: ") + std::strerror(errno), path);
}

}  // namespace

// What is looked at is what is read: a name could lead elsewhere a moment later.
InputFile::InputFile(const std::string& path) : path_(path), file_(path, O_RDONLY | O_NONBLOCK | O_NOCTTY) {
  if (!file_.good()) refuse(path);
  struct stat status {};
  if (fstat(file_.number(), &status) != 0) refuse(path);
  if (S_ISDIR(status.st_mode)) throw ConfigError("", "", "is a directory, not a file", path);
  if (!S_ISREG(status.st_mode)) throw ConfigError("", "", "is not a regular file", path);
}

std::size_t InputFile::read(char* data, std::size_t size) {
  while (true) {
    const ssize_t count = ::read(file_.number(), data, size);
    if (count >= 0) return static_cast<std::size_t>(count);
    if (errno != EINTR) refuse(path_);
  }
}

std::string InputFile::read(std::size_t most) {
  std::string text;
  char piece[1u << 14];
  while (text.size() < most) {
    const std::size_t count = read(piece, std::min(sizeof piece, most - text.size()));
    if (count == 0) break;
    text.append(piece, count);
  }
  return text;
}

bool fileBeginsWith(const std::string& path, const std::string& bytes) {
  try {
    return InputFile(path).read(bytes.size()) == bytes;
  } catch (const ConfigError&) {
    return false;
  }
}

}  // namespace brash_ice_rig
