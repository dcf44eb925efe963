#include "brash_ice_rig/output/directory_lock.h"

#include <cerrno>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "brash_ice_rig/output/output_file.h"

namespace brash_ice_rig {

DirectoryLock::DirectoryLock(const std::string& directory) {
  const std::string path = directory + "/.lock";
  // Children keep it open: while one of a program that was killed still runs, the directory is not free.
  number_ = open(path.c_str(), O_RDWR | O_CREAT, 0666);
  if (number_ < 0) throw OutputError(path, std::generic_category().message(errno));
  // Other errors: a file system without locks, on which users must take care themselves.
  if (flock(number_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
  close(number_);
  throw std::runtime_error(directory + ": another program is at work there; wait for it, or give another --out");
}

DirectoryLock::~DirectoryLock() {
  close(number_);
}

}  // namespace brash_ice_rig
