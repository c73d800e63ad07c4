// SPDX-License-Identifier: Apache-2.0
// Goal: with two hosts the loss of either is no stop: the fallback takes over from a policy that was killed or frozen,
// hands back to one that returns, and the robot stops when both are gone; the record says who moved it, and replays.
// Method: the demo arm with its own network as the fallback policy, real processes on the loopback bus, hosts ended and
// stopped by signals; the run folder is judged afterwards.
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "config/load.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/process/sent_frames.hpp"
#include "tests/support/files.hpp"
#include "tests/support/replaced.hpp"

namespace takt::test {
namespace {

// The demo arm, whose fallback is its own network in a second host.
std::string arm_with_fallback() {
  const std::string path = testing::TempDir() + "takt-arm6-with-fallback.yaml";
  std::string text = replaced(text_of("config/arm6.yaml"), "behaviour: hold ", "behaviour: fallback ");
  text = replaced(text, "fallback: none ", "fallback: second ");
  text = replaced(text, "fallbacks:\n", "fallbacks:\n  second: { kind: policy, for: 0 s }\n");
  text =
      replaced(text, "file: arm6_reach.onnx", "file: " + std::filesystem::absolute("config/arm6_reach.onnx").string());
  std::ofstream(path) << text;
  return path;
}

bool wait_for_player(const RunningRobot& robot, Player player) {
  const auto last = robot.wait_until([player](const StatusSnapshot& status) { return status.tick.player == player; });
  return last && last->status.tick.player == player;
}

TEST(FallbackPolicyProcess, EitherHostMayGoAndComeBackAndBothGoneStops) {
  const std::string file = arm_with_fallback();
  RunningRobot robot({}, file);
  Child policy = robot.start_policy_host();
  EXPECT_TRUE(robot.wait_until(
      [](const StatusSnapshot& s) { return s.tick.seats[Seat::policy].freshness == Freshness::fresh; }));
  const auto refused = robot.takt({"arm", "--runtime-dir", robot.directory()});
  EXPECT_FALSE(refused) << "the fallback policy is not there yet";
  Child fallback = robot.start_fallback_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  ASSERT_TRUE(wait_for_player(robot, Player::policy)) << robot.logs();

  policy.signal(SIGSTOP);
  ASSERT_TRUE(wait_for_player(robot, Player::fallback)) << robot.logs();
  robot.let_run(1500);  // far beyond stop_after
  EXPECT_EQ(robot.status()->status.tick.mode, Mode::degraded) << robot.logs();
  policy.signal(SIGCONT);
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  ASSERT_TRUE(wait_for_player(robot, Player::policy)) << robot.logs();

  policy.signal(SIGKILL);
  EXPECT_EQ(policy.wait(std::chrono::seconds(20)), 128 + SIGKILL);
  ASSERT_TRUE(wait_for_player(robot, Player::fallback)) << robot.logs();
  policy = robot.start_policy_host();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();

  fallback.signal(SIGKILL);
  EXPECT_EQ(fallback.wait(std::chrono::seconds(20)), 128 + SIGKILL);
  robot.let_run(1500);
  EXPECT_EQ(robot.status()->status.tick.mode, Mode::tracking) << robot.logs();
  fallback = robot.start_fallback_host();
  ASSERT_TRUE(robot.wait_until(
      [](const StatusSnapshot& s) { return s.tick.seats[Seat::fallback].freshness == Freshness::fresh; }));

  policy.signal(SIGKILL);
  ASSERT_TRUE(wait_for_player(robot, Player::fallback)) << robot.logs();
  fallback.signal(SIGKILL);
  ASSERT_TRUE(robot.wait_for_mode(Mode::damped_stop)) << robot.logs();
  EXPECT_NE(std::string(robot.status()->incident.sentence).find("of the fallback policy second neither"),
            std::string::npos)
      << robot.status()->incident.sentence;

  ASSERT_TRUE(robot.finish()) << robot.logs();
  const SentFrames frames = judge_sent_frames(robot.run_directory(), config::load(file).value());
  EXPECT_GT(frames.motion_commands, 1000U);
  EXPECT_EQ(frames.first_violation, "");
  EXPECT_NE(text_of(robot.directory() + "/executive.log").find("the fallback policy took over"), std::string::npos);
  Child replay({"takt", "replay", robot.run_directory()}, robot.directory() + "/replay.log");
  EXPECT_EQ(replay.wait(std::chrono::seconds(60)), 0) << text_of(robot.directory() + "/replay.log");
  Child report({"takt", "report", robot.run_directory()}, robot.directory() + "/report.log");
  EXPECT_EQ(report.wait(std::chrono::seconds(60)), 0);
  EXPECT_NE(text_of(robot.directory() + "/report.log").find("moved by the fallback policy"), std::string::npos);
}

TEST(FallbackPolicyProcess, AHostOfARobotWithoutOneSaysSo) {
  const std::string log = testing::TempDir() + "takt-no-fallback.log";
  Child host({"takt-policy-host", "--fallback", "--robot", "config/arm6.yaml"}, log);
  EXPECT_EQ(host.wait(std::chrono::seconds(20)), 65);
  EXPECT_NE(text_of(log).find("has no fallback policy; name one of kind `policy` in degraded.fallback"),
            std::string::npos)
      << text_of(log);
}

// `takt run` starts both, and a script may end either.
TEST(FallbackPolicyProcess, RunSupervisesBoth) {
  const std::string file = arm_with_fallback();
  const std::string folder = testing::TempDir() + "takt-run-with-fallback";
  std::filesystem::remove_all(folder);
  Child run({"takt", "run", file, "--arm", "--allow-non-realtime", "--duration", "6s", "--runtime-dir", folder + "/rt",
             "--run-dir", folder + "/run", "--at", "2s: kill policy"},
            testing::TempDir() + "takt-run-with-fallback.log");
  EXPECT_EQ(run.wait(std::chrono::seconds(90)), 0) << text_of(testing::TempDir() + "takt-run-with-fallback.log");
  EXPECT_NE(text_of(folder + "/run/logs/takt-policy-host-fallback.log").find("attached"), std::string::npos);
  EXPECT_NE(text_of(folder + "/run/metrics.json").find("\"ticks_of_player\""), std::string::npos);
}

}  // namespace
}  // namespace takt::test
