// SPDX-License-Identifier: Apache-2.0
// Goal: takt-policy-host refuses what it must before it attaches, in one line and with the documented exit code, and
// ends cleanly on SIGTERM while it waits. Method: the real program on copies of the demo robot's file with one edit
// each.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "executive/contract/monotonic_clock.hpp"
#include "tests/policy_host/fake_server.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

using test::text_of;

class Program : public testing::Test {
 protected:
  pid_t start(std::vector<std::string> arguments) {
    const pid_t pid = fork();
    if (pid != 0) return pid;
    if (freopen(said_.c_str(), "w", stderr) == nullptr) _exit(126);
    arguments.insert(arguments.begin(), "takt-policy-host");
    std::vector<char*> raw;
    for (std::string& argument : arguments) raw.push_back(argument.data());
    raw.push_back(nullptr);
    execv(TAKT_POLICY_HOST, raw.data());
    _exit(127);
  }
  static int wait_for(pid_t pid) {
    int status = 0;
    waitpid(pid, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  // A copy of the demo robot's file, beside the real policy, with `from` replaced by `to`.
  std::string robot_with(const std::string& from, const std::string& to) {
    std::string text = text_of("config/arm6.yaml");
    const auto at = text.find(from);
    if (at == std::string::npos) throw std::runtime_error("config/arm6.yaml has no " + from);
    text.replace(at, from.size(), to);
    std::filesystem::copy("config/arm6_reach.onnx", directory_.path("arm6_reach.onnx"));
    std::ofstream(directory_.path("robot.yaml")) << text;
    return directory_.path("robot.yaml");
  }
  // What it says when it must refuse this robot.
  std::string refusal_of(const std::string& robot) {
    EXPECT_EQ(wait_for(start({"--robot", robot, "--runtime-dir", directory_.path()})), 65);
    std::string said = text_of(said_);
    EXPECT_EQ(std::ranges::count(said, '\n'), 1) << said;
    return said;
  }

  test::TemporaryDirectory directory_;
  std::string said_ = directory_.path("said");
};

TEST_F(Program, RefusesTermsThatDoNotAddUp) {
  const auto said = refusal_of(robot_with("scale: 1, history: 2 }", "scale: 1, history: 3 }"));
  EXPECT_NE(said.find("obs wants 24 values, the configuration's terms give 27: joint_position_relative 6 + "
                      "joint_velocity 6 + sensor target 3 x 3 + last_action 6"),
            std::string::npos)
      << said;
}

TEST_F(Program, RefusesStepsThatDoNotMatch) {
  const auto said = refusal_of(robot_with("steps: 16", "steps: 12"));
  EXPECT_NE(said.find("actions gives 96 values, the configuration wants 72: 12 steps x 6 outputs"), std::string::npos)
      << said;
}

TEST_F(Program, RefusesATensorNameThatIsNotThere) {
  const auto said = refusal_of(robot_with("input: obs", "input: observation"));
  EXPECT_NE(said.find("no input named observation, it has obs"), std::string::npos) << said;
}

TEST_F(Program, RefusesAPolicyFileThatIsNotThere) {
  const auto said = refusal_of(robot_with("file: arm6_reach.onnx", "file: absent.onnx"));
  EXPECT_NE(said.find("absent.onnx"), std::string::npos) << said;
}

TEST_F(Program, UsageErrorsHaveTheirOwnCode) {
  EXPECT_EQ(wait_for(start({"--runtime-dir", directory_.path()})), 64);
}

TEST_F(Program, EndsCleanlyOnSigtermWhileItWaits) {
  const pid_t pid = start({"--robot", "config/arm6.yaml", "--runtime-dir", directory_.path()});
  for (int i = 0; i < 3000 && text_of(said_).find("waiting for the executive") == std::string::npos; ++i) {
    sleep_until(monotonic_now() + milliseconds(10));
  }
  kill(pid, SIGTERM);
  EXPECT_EQ(wait_for(pid), 0);
  EXPECT_NE(text_of(said_).find("waiting for the executive"), std::string::npos);
}

// Goal: with several networks the program still ends by a signal while it waits. Method: as one reads it.
TEST_F(Program, EndsOnSigtermWithSeveralRequestsInFlight) {
  const pid_t pid = start({"--robot", robot_with("  steps: 16", "  requests_in_flight: 4\n  steps: 16"),
                           "--runtime-dir", directory_.path()});
  const MonoTime give_up = monotonic_now() + seconds(20);
  while (text_of(said_).find("waiting for the executive") == std::string::npos && monotonic_now() < give_up)
    sleep_until(monotonic_now() + milliseconds(5));
  kill(pid, SIGTERM);
  EXPECT_EQ(wait_for(pid), 0) << text_of(said_);
}

}  // namespace
}  // namespace takt::policy_host
