#include "brash_ice_rig/study/claims.h"

#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "../output/temporary_directory.h"

namespace brash_ice_rig {
namespace {

using Answer = Claims::Answer;

void pause(int ms) {
  std::this_thread::sleep_for(std::chrono::milliseconds(ms));
}

/// A claim of a process under another kernel, of which we know only what we see.
std::string strange(const std::string& lease = "0000000.300") {
  return "far,1,2,3 other_kernel 1 1 " + lease + " 0000000001\n";
}

TEST(Claims, OneHasItUntilItGivesItBack) {
  const TemporaryDirectory directory;
  Claims first(30.0), second(30.0);
  EXPECT_FALSE(Claims::isClaimed(directory.path()));
  EXPECT_EQ(first.claim(directory.path()), Answer::kMine);
  EXPECT_EQ(second.claim(directory.path()), Answer::kBusy);
  EXPECT_TRUE(Claims::isClaimed(directory.path()));
  EXPECT_FALSE(second.release(directory.path()));
  EXPECT_EQ(second.claim(directory.path()), Answer::kBusy);
  EXPECT_TRUE(first.release(directory.path()));
  EXPECT_FALSE(Claims::isClaimed(directory.path()));
  EXPECT_EQ(second.claim(directory.path()), Answer::kMine);
}

TEST(Claims, OfManyThatAskAtOnceOneGetsIt) {
  constexpr int kAskers = 8;
  const TemporaryDirectory directory;
  for (int round = 0; round < 20; ++round) {
    // Every other time there is a dead one's place to take.
    const std::string name = "d" + std::to_string(round);
    std::filesystem::create_directory(directory.file(name));
    if (round % 2 == 1) directory.put(name + "/claim.1", strange("0000000.050"));
    std::atomic<int> owners{0}, done{0};
    std::vector<std::thread> askers;
    for (int i = 0; i < kAskers; ++i) {
      askers.emplace_back([&] {
        Claims claims(30.0);
        for (int look = 0; look < 15; ++look) {
          if (claims.claim(directory.file(name)) != Answer::kBusy) ++owners;
          pause(10);
        }
        // Nobody gives it back before all have asked, however slow the machine.
        ++done;
        while (done < kAskers) pause(1);
      });
    }
    for (std::thread& asker : askers) asker.join();
    EXPECT_EQ(owners, 1) << "round " << round;
  }
}

TEST(Claims, WhoShowsNoSignOfLifeForItsLeaseIsDead) {
  const TemporaryDirectory directory;
  directory.put("claim.1", strange());
  Claims claims(30.0);
  EXPECT_EQ(claims.claim(directory.path()), Answer::kBusy);
  pause(200);
  EXPECT_EQ(claims.claim(directory.path()), Answer::kBusy);
  pause(200);
  EXPECT_EQ(claims.claim(directory.path()), Answer::kInherited);
  claims.release(directory.path());
  EXPECT_FALSE(Claims::isClaimed(directory.path())) << "the dead one's claim goes, too";
}

TEST(Claims, SignsOfLifeKeepIt) {
  const TemporaryDirectory directory;
  Claims claims(30.0);
  for (int beat = 0; beat < 8; ++beat) {
    directory.put("claim.1", strange() + std::to_string(beat));
    EXPECT_EQ(claims.claim(directory.path()), Answer::kBusy);
    pause(100);
  }
}

TEST(Claims, AClaimCutShortByTheDeathOfItsOwnerIsGivenTheLeaseOfTheOneWhoLooks) {
  const TemporaryDirectory directory;
  directory.put("claim.7", "");
  Claims claims(0.2);
  EXPECT_EQ(claims.claim(directory.path()), Answer::kBusy);
  pause(300);
  EXPECT_EQ(claims.claim(directory.path()), Answer::kInherited);
}

TEST(Claims, OfAProcessOnThisComputerTheDeathIsSeenAtOnce) {
  const TemporaryDirectory directory;
  const pid_t child = fork();
  if (child == 0) {
    const Answer answer = (new Claims(3600.0))->claim(directory.path());
    _exit(answer == Answer::kMine ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
  ASSERT_TRUE(Claims::isClaimed(directory.path()));
  Claims claims(3600.0);
  EXPECT_EQ(claims.claim(directory.path()), Answer::kInherited);
}

TEST(Claims, WhoeverHasBeenTakenForDeadFindsOutAndDoesNotDisturbTheNewOwner) {
  const TemporaryDirectory directory;
  Claims claims(0.3);
  ASSERT_EQ(claims.claim(directory.path()), Answer::kMine);
  pause(100);
  EXPECT_TRUE(claims.renew().empty());
  directory.put("claim.2", strange("0003600.000"));
  pause(100);
  EXPECT_EQ(claims.renew(), std::vector<std::string>{directory.path()});
  EXPECT_FALSE(claims.release(directory.path()));
  EXPECT_TRUE(std::filesystem::exists(directory.file("claim.2")));
  EXPECT_EQ(claims.claim(directory.path()), Answer::kBusy);
}

}  // namespace
}  // namespace brash_ice_rig
