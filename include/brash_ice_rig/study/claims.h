#pragma once

#include <chrono>
#include <map>
#include <string>
#include <vector>

namespace brash_ice_rig {

/// Shares out directories among processes on any number of computers that see the same file system. Who works in a
/// directory keeps a file claim.N there and changes it now and then; one that does not change for the lease of its
/// owner is dead, and claim.N+1 takes its place. That needs nothing of the file system but that creating a file of a
/// name that exists fails (O_EXCL; NFS does that from version 3 on): no locks, no clocks that agree.
///
/// The content of a directory with a claim in it is not to be relied on. Nor need it be protected: whoever has been
/// taken for dead by mistake finds out at its next sign of life, and what it still writes meets a claimed directory.
class Claims {
 public:
  enum class Answer {
    kBusy,       ///< somebody else has it
    kMine,       ///< nobody had it
    kInherited,  ///< mine, and its last owner died at work
  };

  /// @param lease_s  others take this process for dead when they have seen no sign of life for so long, s
  explicit Claims(double lease_s);
  /// Gives back all.
  ~Claims();
  Claims(const Claims&) = delete;
  Claims& operator=(const Claims&) = delete;

  /// Asks for a directory, which exists.
  /// @throws OutputError if no file can be created there
  Answer claim(const std::string& directory);

  /// Gives a directory back. @return false if another process has taken it over, or it has not been ours
  bool release(const std::string& directory);

  /// Gives a sign of life for all directories, often enough if called several times per second.
  /// @return those that another process has taken over; they are no longer ours
  std::vector<std::string> renew();

  /// Whether somebody, who may be dead or we ourselves, is at work there.
  static bool isClaimed(const std::string& directory);

  /// One word that no other object of this class has.
  const std::string& name() const { return name_; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Sight {
    std::string text;
    Clock::time_point since;
  };

  bool isDead(const std::string& path);
  std::string text() const;

  double lease_s_;
  std::string name_;
  std::string process_;  ///< where and who we are
  std::map<std::string, int> mine_;
  std::map<std::string, Sight> seen_;  ///< by path of the claim
  long beat_ = 0;
  Clock::time_point renewed_ = Clock::now();
};

}  // namespace brash_ice_rig
