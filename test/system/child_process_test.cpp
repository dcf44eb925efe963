#include "brash_ice_rig/system/child_process.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <string>
#include <system_error>

#include <gtest/gtest.h>

#include "../output/temporary_directory.h"

namespace brash_ice_rig {
namespace {

constexpr std::chrono::seconds kLong{60};

ChildSetup shell(const std::string& script) {
  ChildSetup setup;
  setup.program = "/bin/sh";
  setup.arguments = {"-c", script};
  return setup;
}

TEST(ChildProcess, TellsExitCodeOrSignal) {
  const std::optional<ChildEnd> good = ChildProcess(shell("exit 0")).wait(kLong);
  ASSERT_TRUE(good);
  EXPECT_TRUE(good->success());
  const std::optional<ChildEnd> bad = ChildProcess(shell("exit 7")).wait(kLong);
  ASSERT_TRUE(bad);
  EXPECT_FALSE(bad->success());
  EXPECT_EQ(bad->text(), "exit code 7");
  const std::optional<ChildEnd> killed = ChildProcess(shell("kill -KILL $$")).wait(kLong);
  ASSERT_TRUE(killed);
  EXPECT_FALSE(killed->success());
  EXPECT_EQ(killed->text(), "ended by signal 9 (Killed)");
}

TEST(ChildProcess, LogTakesBothStreamsAndReplacesTheOld) {
  const TemporaryDirectory directory;
  ChildSetup setup = shell("echo out; echo err >&2");
  setup.log_file = directory.put("log.txt", "a much longer text from an earlier child\n");
  ASSERT_TRUE(ChildProcess(setup).wait(kLong));
  EXPECT_EQ(readFile(setup.log_file), "out\nerr\n");
}

TEST(ChildProcess, WhatCannotStartIsAnErrorThatNamesIt) {
  const auto what = [](const ChildSetup& setup) {
    try {
      ChildProcess child(setup);
    } catch (const std::system_error& error) {
      return std::string(error.what());
    }
    return std::string("started");
  };
  ChildSetup setup = shell("exit 0");
  setup.log_file = "/no/such/directory/log.txt";
  EXPECT_EQ(what(setup), "/no/such/directory/log.txt: No such file or directory");
  setup = shell("exit 0");
  setup.program = "/no/such/program";
  EXPECT_EQ(what(setup), "/no/such/program: No such file or directory");
}

TEST(ChildProcess, HidesVariablesByTheirBeginning) {
  const TemporaryDirectory directory;
  setenv("SECRET_1", "1", 1);
  setenv("NOT_SECRET_1", "1", 1);
  ChildSetup setup = shell("echo ${SECRET_1-none} ${NOT_SECRET_1-none}");
  setup.log_file = directory.file("log.txt");
  setup.hidden_variables = {"SECRET_"};
  ASSERT_TRUE(ChildProcess(setup).wait(kLong));
  unsetenv("SECRET_1");
  unsetenv("NOT_SECRET_1");
  EXPECT_EQ(readFile(setup.log_file), "none 1\n");
}

TEST(ChildProcess, WaitEndsAtItsTimeoutOrWhenAsked) {
  ChildProcess child(shell("exec sleep 600"));
  EXPECT_FALSE(child.wait(std::chrono::milliseconds(50)));
  int asked = 0;
  EXPECT_FALSE(child.wait(kLong, [&asked] { return ++asked == 2; }));
  EXPECT_EQ(asked, 2);
  child.sendSignal(SIGTERM);
  const std::optional<ChildEnd> end = child.wait(kLong);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->text(), "ended by signal 15 (Terminated)");
}

TEST(ChildProcess, DoesNotOutliveItsOwner) {
  pid_t id = 0;
  {
    const ChildProcess child(shell("trap '' TERM; exec sleep 600"));
    id = child.id();
    ASSERT_EQ(kill(id, 0), 0);
  }
  EXPECT_EQ(kill(id, 0), -1) << "still there, or not waited for";
}

TEST(ChildProcess, StandardInputEndsWhenThePipeIsClosed) {
  int ends[2];
  ASSERT_EQ(pipe2(ends, O_CLOEXEC), 0);
  ChildSetup setup = shell("cat");
  setup.standard_input = ends[0];
  ChildProcess child(setup);
  EXPECT_FALSE(child.wait(std::chrono::milliseconds(100))) << "the pipe is open: nothing to end for";
  close(ends[1]);
  const std::optional<ChildEnd> end = child.wait(kLong);
  close(ends[0]);
  ASSERT_TRUE(end);
  EXPECT_TRUE(end->success());
}

TEST(ChildProcess, OwnGroupIsTheChilds) {
  ChildSetup setup = shell("exec sleep 600");
  const ChildProcess same(setup);
  EXPECT_EQ(getpgid(same.id()), getpgrp());
  setup.own_group = true;
  const ChildProcess own(setup);
  EXPECT_EQ(getpgid(own.id()), own.id());
}

TEST(ProgramBesideThis, LiesInTheSameDirectory) {
  char self[4096];
  const ssize_t length = readlink("/proc/self/exe", self, sizeof self);
  ASSERT_GT(length, 0);
  const std::string path(self, static_cast<std::size_t>(length));
  EXPECT_EQ(programBesideThis(path.substr(path.rfind('/') + 1)), path);
}

}  // namespace
}  // namespace brash_ice_rig
