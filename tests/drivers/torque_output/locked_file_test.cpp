// SPDX-License-Identifier: Apache-2.0
// Goal: the simulated torque output does what a line does: others see the permission, it ends with its holder however
// that ends, and an output that another process holds, or that is gone, is not as told. Method: real files; a child
// process that kills itself.
#include "drivers/torque_output/locked_file.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

namespace takt::drivers {
namespace {

class LockedFileTest : public testing::Test {
 protected:
  LockedFileTest() {
    wanted.output = config::TorqueOutputKind::file;
    wanted.file = testing::TempDir() + "takt-torque-" + std::to_string(getpid());
  }
  ~LockedFileTest() override { std::filesystem::remove(wanted.file); }
  config::SafeTorqueOff wanted;
};

TEST_F(LockedFileTest, OthersSeeThePermissionUntilItsEnd) {
  EXPECT_FALSE(is_torque_permitted(wanted.file)) << "no such file";
  {
    const auto opened = open_torque_output(wanted).value();
    EXPECT_FALSE(is_torque_permitted(wanted.file));
    EXPECT_TRUE(opened.output->tell(true));
    EXPECT_TRUE(is_torque_permitted(wanted.file));
    EXPECT_TRUE(opened.output->tell(false));
    EXPECT_FALSE(is_torque_permitted(wanted.file));
    EXPECT_TRUE(opened.output->tell(true));
  }
  EXPECT_FALSE(is_torque_permitted(wanted.file));
}

TEST_F(LockedFileTest, ItEndsWithAProcessThatIsKilled) {
  const pid_t child = fork();
  if (child == 0) {
    const auto opened = open_torque_output(wanted);
    const bool permitted = opened && opened->output->tell(true) && is_torque_permitted(wanted.file);
    kill(getpid(), permitted ? SIGKILL : SIGABRT);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) << "it was permitted";
  EXPECT_FALSE(is_torque_permitted(wanted.file));
}

TEST_F(LockedFileTest, WhatSomebodyElseHoldsOrHasRemovedIsNotAsTold) {
  const auto ours = open_torque_output(wanted).value();
  {
    const auto theirs = open_torque_output(wanted).value();
    ASSERT_TRUE(theirs.output->tell(true));
    EXPECT_FALSE(ours.output->tell(true));
  }
  EXPECT_TRUE(ours.output->tell(true));
  std::filesystem::remove(wanted.file);
  EXPECT_FALSE(ours.output->tell(true));
  EXPECT_FALSE(ours.output->tell(false));
}

TEST_F(LockedFileTest, APlaceThatIsNotThereIsTold) {
  wanted.file = "/no/such/folder/torque";
  EXPECT_EQ(
      open_torque_output(wanted).error(),
      "safety.safe_torque_off: /no/such/folder/torque: No such file or directory: name a file in a folder where this "
      "user may write");
}

}  // namespace
}  // namespace takt::drivers
