#include "brash_ice_rig/study/claims.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include "brash_ice_rig/output/output_file.h"

namespace brash_ice_rig {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPrefix = "claim.";

/// Signs of life per lease: some may be late or lost.
constexpr double kBeatsPerLease = 6.0;

std::string claimPath(const std::string& directory, int number) {
  return directory + "/" + kPrefix + std::to_string(number);
}

/// Numbers of the claims in a directory, in no order.
std::vector<int> claimNumbers(const std::string& directory) {
  std::vector<int> numbers;
  std::error_code error;
  for (fs::directory_iterator entry(directory, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.rfind(kPrefix, 0) != 0) continue;
    int number = 0;  // stays where what follows is none
    std::from_chars(name.data() + std::string(kPrefix).size(), name.data() + name.size(), number);
    if (number > 0) numbers.push_back(number);
  }
  return numbers;
}

int highest(const std::vector<int>& numbers) {
  return numbers.empty() ? 0 : *std::max_element(numbers.begin(), numbers.end());
}

std::string firstWord(const std::string& path) {
  std::ifstream in(path);
  std::string word;
  in >> word;
  return word.empty() ? "unknown" : word;
}

/// What a kernel and its process ids are known by. Containers on one computer share the first part only.
std::string kernelName() {
  std::error_code error;
  const std::string ids = fs::read_symlink("/proc/self/ns/pid", error).string();
  return firstWord("/proc/sys/kernel/random/boot_id") + "," + (ids.empty() ? "unknown" : ids);
}

/// When a process was started, in the kernel's ticks; empty if there is none of that id or it is only waited for.
std::string startOf(const std::string& id) {
  const std::string stat = textOfFileIfThere("/proc/" + id + "/stat");
  // The second field is the program's name in brackets and may hold anything.
  const auto name_end = stat.rfind(')');
  if (name_end == std::string::npos) return "";
  std::istringstream fields(stat.substr(name_end + 1));
  std::string field;
  for (int number = 3; number <= 22 && fields >> field; ++number) {
    if (number == 3 && (field == "Z" || field == "X")) return "";
  }
  return field;
}

}  // namespace

Claims::Claims(double lease_s) : lease_s_(lease_s) {
  char host[256] = "unknown";
  gethostname(host, sizeof host - 1);
  const std::string id = std::to_string(getpid());
  process_ = kernelName() + " " + id + " " + startOf(id);
  static int objects = 0;
  name_ = std::string(host) + "," + firstWord("/proc/sys/kernel/random/uuid").substr(0, 8) + "," + id + "," +
          std::to_string(++objects);
}

Claims::~Claims() {
  while (!mine_.empty()) {
    const std::string directory = mine_.begin()->first;  // release() erases the one in the map
    release(directory);
  }
}

/// name, kernel, process id, its start, lease, beat; of the same length always, so that it can be rewritten in place
/// even when the disk is full.
std::string Claims::text() const {
  char end[64];
  std::snprintf(end, sizeof end, " %010.3f %010ld\n", lease_s_, beat_);
  return name_ + " " + process_ + end;
}

bool Claims::isDead(const std::string& path) {
  const std::string text = textOfFileIfThere(path);
  std::istringstream words(text);
  std::string name, kernel, id, start;
  double lease_s = 0.0;
  // Whoever died before it could write so much, or has just given it back, gets the lease that we have.
  if (!(words >> name >> kernel >> id >> start >> lease_s)) lease_s = lease_s_;
  // Of processes under our own kernel we know more than what they tell.
  if (kernel == kernelName() && kernel.find("unknown") == std::string::npos && startOf(id) != start) return true;
  Sight& sight = seen_[path];
  const auto now = Clock::now();
  if (sight.since == Clock::time_point() || sight.text != text) sight = {text, now};
  return std::chrono::duration<double>(now - sight.since).count() > lease_s;
}

Claims::Answer Claims::claim(const std::string& directory) {
  const int last = highest(claimNumbers(directory));
  if (last > 0 && !isDead(claimPath(directory, last))) return Answer::kBusy;
  const int number = last + 1;
  const std::string path = claimPath(directory, number);
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file < 0) {
    if (errno == EEXIST) return Answer::kBusy;
    throw OutputError(path, std::generic_category().message(errno));
  }
  const std::string text = this->text();
  const bool written = write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const int error = errno;
  close(file);
  if (!written) {
    unlink(path.c_str());
    throw OutputError(path, std::generic_category().message(error));
  }
  // A listing may have been old. Claims are given back lowest first, so that a higher one tells the truth.
  const std::vector<int> numbers = claimNumbers(directory);
  if (highest(numbers) > number) {
    unlink(path.c_str());
    return Answer::kBusy;
  }
  mine_[directory] = number;
  seen_.erase(claimPath(directory, last));
  // The last owner may have given it back in between, which is an end in order.
  const bool died = last > 0 && std::count(numbers.begin(), numbers.end(), last) > 0;
  return died ? Answer::kInherited : Answer::kMine;
}

bool Claims::release(const std::string& directory) {
  const auto found = mine_.find(directory);
  if (found == mine_.end()) return false;
  const int number = found->second;
  mine_.erase(found);
  std::vector<int> numbers = claimNumbers(directory);
  if (highest(numbers) > number) return false;  // its new owner's
  std::sort(numbers.begin(), numbers.end());
  for (const int old : numbers) unlink(claimPath(directory, old).c_str());
  return true;
}

std::vector<std::string> Claims::renew() {
  const auto now = Clock::now();
  std::vector<std::string> lost;
  if (std::chrono::duration<double>(now - renewed_).count() < lease_s_ / kBeatsPerLease) return lost;
  renewed_ = now;
  ++beat_;
  const std::string text = this->text();
  for (auto claim = mine_.begin(); claim != mine_.end();) {
    const auto& [directory, number] = *claim;
    const int file = open(claimPath(directory, number).c_str(), O_WRONLY | O_CLOEXEC);
    const bool gone = file < 0 && errno == ENOENT;
    if (file >= 0) {
      // One that fails is late; the next may do.
      [[maybe_unused]] const ssize_t written = write(file, text.data(), text.size());
      close(file);
    }
    if (gone || highest(claimNumbers(directory)) > number) {
      lost.push_back(directory);
      claim = mine_.erase(claim);
    } else {
      ++claim;
    }
  }
  return lost;
}

bool Claims::isClaimed(const std::string& directory) {
  return !claimNumbers(directory).empty();
}

}  // namespace brash_ice_rig
