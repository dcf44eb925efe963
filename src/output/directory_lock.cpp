#include "brash_ice_rig/output/directory_lock.h"

#include <cerrno>
#include <chrono>
#include <stdexcept>
#include <system_error>
#include <thread>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "brash_ice_rig/output/output_file.h"

namespace brash_ice_rig {
namespace {

/// What the first of several programs gets to write down its work and to tidy up.
constexpr std::chrono::seconds kPatience{10};

/// @throws OutputError
int openLock(const std::string& directory) {
  const std::string path = directory + "/.lock";
  // Children keep it open: while one of a program that was killed still runs, the directory is not free.
  const int number = open(path.c_str(), O_RDWR | O_CREAT, 0666);
  if (number < 0) throw OutputError(path, std::generic_category().message(errno));
  return number;
}

/// @param kind  LOCK_EX or LOCK_SH
/// @return false if another program's lock is in the way. A file system without locks has none, and users must take
///   care themselves
bool isLocked(int number, int kind) {
  return flock(number, kind | LOCK_NB) == 0 || errno != EWOULDBLOCK;
}

std::string content(int number) {
  std::string text(4096, '\0');
  const ssize_t size = pread(number, text.data(), text.size(), 0);
  text.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  return text;
}

}  // namespace

DirectoryLock::DirectoryLock(const std::string& directory) : number_(openLock(directory)) {
  if (isLocked(number_, LOCK_EX)) return;
  close(number_);
  throw std::runtime_error(directory + ": another program is at work there; wait for it, or give another --out");
}

DirectoryLock::DirectoryLock(const std::string& directory, const std::string& work, const std::function<void()>& first)
    : number_(openLock(directory)) {
  try {
    const auto start = std::chrono::steady_clock::now();
    while (true) {
      if (isLocked(number_, LOCK_EX)) {
        if (ftruncate(number_, 0) != 0 || pwrite(number_, work.data(), work.size(), 0) < 0) {
          throw OutputError(directory + "/.lock", std::generic_category().message(errno));
        }
        first();
        isLocked(number_, LOCK_SH);
        return;
      }
      if (isLocked(number_, LOCK_SH)) {
        if (content(number_) == work) return;
        flock(number_, LOCK_UN);
      }
      if (std::chrono::steady_clock::now() - start > kPatience) {
        throw std::runtime_error(directory +
                                 ": another program is at work there, on something else or without --share; wait for "
                                 "it, or give another --out");
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  } catch (...) {
    close(number_);
    throw;
  }
}

DirectoryLock::~DirectoryLock() {
  close(number_);
}

}  // namespace brash_ice_rig
