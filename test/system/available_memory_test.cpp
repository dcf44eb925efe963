#include "brash_ice_rig/system/available_memory.h"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "../output/temporary_directory.h"

namespace brash_ice_rig {
namespace {

class AvailableMemory : public ::testing::Test {
 protected:
  void put(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories(std::filesystem::path(root_.file(name)).parent_path());
    root_.put(name, text);
  }
  double available() const { return availableMemory(root_.path()); }

  TemporaryDirectory root_;
};

TEST_F(AvailableMemory, IsWhatTheMachineHasFree) {
  EXPECT_TRUE(std::isinf(available())) << "nothing tells";
  put("proc/meminfo", "MemTotal:       2000000 kB\nMemFree:  100 kB\nMemAvailable:   1000000 kB\n");
  EXPECT_EQ(available(), 1024.0e6);
}

TEST_F(AvailableMemory, IsWhatIsLeftInTheTightestOfNestedControlGroups) {
  put("proc/meminfo", "MemAvailable: 8000000 kB\n");
  put("proc/self/cgroup", "0::/job/step\n");
  put("sys/fs/cgroup/job/step/memory.max", "max\n");
  EXPECT_EQ(available(), 8192.0e6);
  put("sys/fs/cgroup/job/memory.max", "2000000000\n");
  put("sys/fs/cgroup/job/memory.current", "900000000\n");
  EXPECT_EQ(available(), 1.1e9);
  put("sys/fs/cgroup/job/memory.stat", "anon 5\ninactive_file 400000000\n");
  EXPECT_EQ(available(), 1.5e9) << "files in memory can be dropped";
  put("sys/fs/cgroup/memory.max", "1000000000\n");
  put("sys/fs/cgroup/memory.current", "1200000000\n");
  EXPECT_EQ(available(), 0.0);
}

TEST_F(AvailableMemory, IsWhatIsLeftInAControlGroupOfTheFirstVersion) {
  put("proc/meminfo", "MemAvailable: 8000000 kB\n");
  put("proc/self/cgroup", "5:cpu:/a\n4:memory:/docker/b\n0::/\n");
  put("sys/fs/cgroup/memory/docker/b/memory.limit_in_bytes", "3000000000\n");
  put("sys/fs/cgroup/memory/docker/b/memory.usage_in_bytes", "1000000000\n");
  EXPECT_EQ(available(), 2.0e9);
  put("sys/fs/cgroup/memory/memory.limit_in_bytes", "1500000000\n");  // all that a container sees
  EXPECT_EQ(available(), 1.5e9);
}

TEST_F(AvailableMemory, IsNoMoreThanTheLimitOnTheAddressSpaceLeaves) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's own shadow needs more address space than the limit leaves";
#endif
  const pid_t child = fork();
  if (child == 0) {
    const rlimit limit{4ul << 30, 4ul << 30};
    setrlimit(RLIMIT_AS, &limit);
    _exit(availableMemory() < 4.0 * (1ul << 30) ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}

}  // namespace
}  // namespace brash_ice_rig
