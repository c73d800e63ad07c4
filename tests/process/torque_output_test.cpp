// SPDX-License-Identifier: Apache-2.0
// Goal: the output that permits torque does so while the robot is armed, drops when a person wants no power, when the
// executive ends, and when it is killed outright; one that fails is a named stop, and one that cannot be had keeps the
// executive from starting. Method: real processes; the output is the lock on a file, which this test asks the kernel
// for.
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>

#include "drivers/torque_output/locked_file.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::test {
namespace {

using namespace std::chrono_literals;

// The demo robot with an output, in a folder of its own.
class TorqueOutput : public testing::Test {
 protected:
  TorqueOutput() {
    std::filesystem::copy_file("config/arm6_reach.onnx", folder_.path("arm6_reach.onnx"));
    write_robot("output: file, file: " + folder_.path("torque"));
  }
  void write_robot(const std::string& output) const {
    std::ofstream(robot_file()) << text_of("config/arm6.yaml") << "\nsafety: { safe_torque_off: { " << output
                                << ", on_joint_fault: keep } }\n";
  }
  [[nodiscard]] bool is_permitted() const { return drivers::is_torque_permitted(folder_.path("torque")); }
  // A killed process is gone once it was waited for, and its locks with it; a tick may have to pass otherwise.
  [[nodiscard]] bool becomes(bool permitted) const {
    for (int poll = 0; poll < 2000 && is_permitted() != permitted; ++poll) std::this_thread::sleep_for(10ms);
    return is_permitted() == permitted;
  }
  void track(RunningRobot& robot) const {
    ASSERT_TRUE(robot.wait_for_mode(Mode::standby)) << robot.logs();
    EXPECT_FALSE(is_permitted()) << "in standby";
    ASSERT_EQ(robot.arm(), "") << robot.logs();
    ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
    EXPECT_TRUE(is_permitted()) << "while it moves";
  }

  [[nodiscard]] std::string robot_file() const { return folder_.path("arm6.yaml"); }

  const TemporaryDirectory folder_;
};

TEST_F(TorqueOutput, DropsWhenAPersonWantsNoPowerAndAtTheEnd) {
  RunningRobot robot({}, robot_file());
  const Child policy = robot.start_policy_host();
  track(robot);
  EXPECT_TRUE(robot.takt({"stop", "--now", "--runtime-dir", robot.directory()}));
  ASSERT_TRUE(robot.wait_for_mode(Mode::standby)) << robot.logs();
  EXPECT_TRUE(becomes(false));
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  EXPECT_TRUE(becomes(true));
  EXPECT_TRUE(robot.finish()) << robot.logs();
  EXPECT_FALSE(is_permitted()) << "after SIGTERM";
  Child replay({"takt", "replay", robot.run_directory()}, robot.directory() + "/replay.log");
  EXPECT_EQ(replay.wait(60s), 0);
}

TEST_F(TorqueOutput, DropsWhenTheExecutiveIsKilled) {
  RunningRobot robot({}, robot_file());
  const Child policy = robot.start_policy_host();
  track(robot);
  robot.executive().signal(SIGKILL);
  EXPECT_EQ(robot.executive().wait(20s), 128 + SIGKILL);
  EXPECT_FALSE(is_permitted()) << "the kernel took it back";
}

TEST_F(TorqueOutput, OneThatFailsIsANamedStop) {
  RunningRobot robot({}, robot_file());
  const Child policy = robot.start_policy_host();
  track(robot);
  std::filesystem::remove(folder_.path("torque"));
  ASSERT_TRUE(robot.wait_for_mode(Mode::damped_stop)) << robot.logs();
  EXPECT_TRUE(robot.finish()) << "so that its log is whole";
  EXPECT_NE(robot.logs().find("torque_output_lost: the output that permits torque (safety.safe_torque_off)"),
            std::string::npos)
      << robot.logs();
}

TEST_F(TorqueOutput, OneThatCannotBeHadKeepsTheExecutiveFromStarting) {
  write_robot("output: gpio, chip: /dev/no-such-gpiochip, line: 17");
  RunningRobot robot({}, robot_file());
  EXPECT_EQ(robot.executive().wait(20s), 71) << robot.logs();
  EXPECT_NE(robot.logs().find("safety.safe_torque_off: line 17 of /dev/no-such-gpiochip: No such file"),
            std::string::npos)
      << robot.logs();
}

}  // namespace
}  // namespace takt::test
