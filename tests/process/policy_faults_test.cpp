// SPDX-License-Identifier: Apache-2.0
// Goal: whatever the policy's process does, the executive keeps its period, names the cause, and no frame leaves the
// envelope. Method: real processes on the loopback bus; the policy is killed, frozen, or replaced by one that lies in a
// named way; afterwards the run folder is judged: causes, frames (independent decoder), losses, and replay.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <ostream>
#include <string>

#include "config/load.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/process/sent_frames.hpp"
#include "tests/support/files.hpp"

namespace takt::test {
namespace {

// Blocks until the last writer of the pipe is gone.
std::string read_to_end(int pipe) {
  ::fcntl(pipe, F_SETFL, ::fcntl(pipe, F_GETFL) & ~O_NONBLOCK);
  std::string text;
  std::array<char, 4096> part{};
  for (ssize_t got = 0; (got = ::read(pipe, part.data(), part.size())) > 0;)
    text.append(part.data(), static_cast<std::size_t>(got));
  ::close(pipe);
  return text;
}

// What must be true of every run, however the policy behaved.
void expect_sound_evidence(RunningRobot& robot, const std::string& expected_cause) {
  const auto status = robot.status();
  ASSERT_TRUE(status.has_value()) << robot.logs();
  const auto overruns = [&](OverrunCause cause) { return status->status.overruns[static_cast<std::size_t>(cause)]; };
  EXPECT_EQ(overruns(OverrunCause::blocked), 0U) << "the loop slept inside a tick";
  // A virtual machine that stalls while the loop works looks like slow work; a loop that is too slow is so every tick.
  EXPECT_LT(20 * overruns(OverrunCause::own_overrun), status->status.ticks)
      << "ticks work for longer than their period";

  ASSERT_TRUE(robot.finish()) << robot.logs();
  const std::string transitions = text_of(robot.run_directory() + "/transitions.jsonl");
  EXPECT_NE(transitions.find(expected_cause), std::string::npos) << "no " << expected_cause << " in\n" << transitions;

  const auto config = config::load("config/arm6.yaml");
  ASSERT_TRUE(config.has_value()) << config.error();
  const SentFrames frames = judge_sent_frames(robot.run_directory(), *config);
  EXPECT_GT(frames.motion_commands, 1000U) << "the robot never moved: nothing was tested";
  EXPECT_EQ(frames.first_violation, "");

  Child replay({"takt", "replay", robot.run_directory()}, robot.directory() + "/replay.log");
  EXPECT_EQ(replay.wait(std::chrono::seconds(60)), 0) << text_of(robot.directory() + "/replay.log");
}

void arm_and_track(RunningRobot& robot) {
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
}

TEST(PolicyFaults, KilledPolicyEndsInADampedStop) {
  RunningRobot robot;
  Child policy = robot.start_policy_host();
  arm_and_track(robot);
  policy.signal(SIGKILL);
  ASSERT_TRUE(robot.wait_for_mode(Mode::damped_stop)) << robot.logs();
  expect_sound_evidence(robot, "command_lost");
}

TEST(PolicyFaults, FrozenPolicyDegradesAndRecoversWhenItWakes) {
  RunningRobot robot;
  Child policy = robot.start_policy_host();
  arm_and_track(robot);
  policy.signal(SIGSTOP);
  ASSERT_TRUE(robot.wait_for_mode(Mode::degraded)) << robot.logs();
  policy.signal(SIGCONT);
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  expect_sound_evidence(robot, "contract_restored");
}

TEST(PolicyFaults, SecondPolicyHostIsRefusedByName) {
  RunningRobot robot;
  const Child policy = robot.start_policy_host();
  arm_and_track(robot);
  Child second = robot.start_rogue("nan", "1 s");
  EXPECT_EQ(second.wait(std::chrono::seconds(20)), 69);
  const std::string said = text_of(robot.directory() + "/rogue.log");
  EXPECT_NE(said.find("takt-policy-host"), std::string::npos) << said;
  EXPECT_NE(said.find(std::to_string(policy.pid())), std::string::npos) << said;
  const auto status = robot.status();
  ASSERT_TRUE(status.has_value());
  EXPECT_EQ(status->status.policy_pids[Seat::policy], static_cast<std::uint64_t>(policy.pid()))
      << "the first lease must survive";
}

TEST(MonitorFaults, KilledMonitorStopsTheRobotAndMayComeBack) {
  RunningRobot robot;
  const Child policy = robot.start_policy_host();
  arm_and_track(robot);
  robot.monitor().signal(SIGKILL);
  EXPECT_EQ(robot.monitor().wait(std::chrono::seconds(20)), 128 + SIGKILL);
  ASSERT_TRUE(robot.wait_for_mode(Mode::damped_stop)) << robot.logs();
  EXPECT_NE(text_of(robot.directory() + "/executive.log").find("tracking -> damped_stop: recording_lost"),
            std::string::npos);
  EXPECT_EQ(robot.status()->status.tick.recorded_through, 0U);
  robot.monitor() = robot.start_monitor("run");
  ASSERT_TRUE(robot.reset()) << robot.logs();
  arm_and_track(robot);
}

// Goal: who closes the terminal ends the recorder as the supervisor does: the run folder is whole. Method: SIGHUP,
// while the robot moves.
// Threat: terminal
TEST(MonitorFaults, ATerminalThatIsClosedLeavesAWholeFolder) {
  RunningRobot robot;
  const Child policy = robot.start_policy_host();
  arm_and_track(robot);
  robot.monitor().signal(SIGHUP);
  EXPECT_EQ(robot.monitor().wait(std::chrono::seconds(20)), 0) << robot.logs();
  EXPECT_NE(text_of(robot.run_directory() + "/manifest.json").find("\"complete\": true"), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(robot.run_directory() + "/ticks.mcap"));
}

// Stopped, not killed: its connection stays, its words end. What the tick ring holds meanwhile is recorded later.
// Threat: monitor-frozen
TEST(MonitorFaults, AFrozenMonitorStopsTheRobotAndNoTickIsLost) {
  RunningRobot robot;
  const Child policy = robot.start_policy_host();
  arm_and_track(robot);
  robot.monitor().signal(SIGSTOP);
  ASSERT_TRUE(robot.wait_for_mode(Mode::damped_stop)) << robot.logs();
  robot.monitor().signal(SIGCONT);
  expect_sound_evidence(robot, "recording_lost");
  EXPECT_NE(text_of(robot.run_directory() + "/manifest.json").find("\"recorder\": \"required\""), std::string::npos);
}

TEST(MonitorFaults, WhereTheRobotFileSaysSoTheRobotMovesUnrecorded) {
  RunningRobot robot({}, "config/arm6.yaml", {{"record.recorder", "optional"}});
  const Child policy = robot.start_policy_host();
  arm_and_track(robot);
  robot.monitor().signal(SIGKILL);
  const std::uint64_t later = robot.let_run(500);
  const auto status = robot.status();
  ASSERT_TRUE(status.has_value());
  EXPECT_GE(status->status.ticks, later);
  EXPECT_EQ(status->status.tick.mode, Mode::tracking);
  EXPECT_EQ(status->status.recorder_required, 0);
}

// The review's file is a pipe that holds one page: the review waits until the test reads.
TEST(MonitorFaults, TheNextSessionIsRecordedWhileTheClosedOneIsReviewed) {
  RunningRobot robot;
  const auto recorded = [&] { return robot.wait_until([](const StatusSnapshot& s) { return s.monitor_pid != 0; }); };
  const auto first = recorded();
  ASSERT_TRUE(first && first->status.monitor_pid != 0) << robot.logs();
  robot.let_run(100);
  const std::string written = robot.run_directory() + "/metrics.json";
  ASSERT_EQ(mkfifo(written.c_str(), 0600), 0);
  const int held = ::open(written.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  ASSERT_GE(held, 0);
  ASSERT_EQ(::fcntl(held, F_SETPIPE_SZ, 4096), 4096);
  robot.executive().signal(SIGTERM);
  EXPECT_EQ(robot.executive().wait(std::chrono::seconds(20)), 0);
  robot.executive() = robot.start_executive();
  const auto second = recorded();
  ASSERT_TRUE(second.has_value()) << robot.logs();
  EXPECT_EQ(second->status.monitor_pid, first->status.monitor_pid) << "the same monitor, not waiting for the review";
  const std::string review = read_to_end(held);
  EXPECT_GT(review.size(), 4096U) << "a review that fits the pipe waits for nothing";
  EXPECT_NE(review.find("\"schema\""), std::string::npos) << robot.logs();
  ASSERT_TRUE(robot.finish()) << robot.logs();
  EXPECT_FALSE(text_of(robot.run_directory() + ".2/metrics.json").empty()) << "it waits for its last review";
}

struct Lie {
  const char* when;    // rogue's behaviour by name
  Arrival refused_as;  // counted refusal; none: no refusal expected
  const char* cause;   // in transitions.jsonl
  friend void PrintTo(const Lie& lie, std::ostream* out) { *out << lie.when; }
};

class LyingPolicy : public testing::TestWithParam<Lie> {};

// Threat: policy-lies
TEST_P(LyingPolicy, IsNamedAndTheRobotStops) {
  const Lie& lie = GetParam();
  RunningRobot robot;
  const Child rogue = robot.start_rogue(lie.when, "2 s");
  arm_and_track(robot);
  ASSERT_TRUE(robot.wait_for_mode(Mode::damped_stop)) << robot.logs();
  if (lie.refused_as != Arrival::none) {
    const auto index = static_cast<std::size_t>(lie.refused_as);
    const auto status = robot.wait_until([index](const StatusSnapshot& s) { return s.arrivals[index] > 0; });
    ASSERT_TRUE(status.has_value());
    EXPECT_GT(status->status.arrivals[index], 0U) << name(lie.refused_as) << " was never counted";
  }
  expect_sound_evidence(robot, lie.cause);
}

INSTANTIATE_TEST_SUITE_P(EveryLie, LyingPolicy,
                         testing::Values(Lie{"nan", Arrival::not_finite, "bad_commands"},
                                         Lie{"inf", Arrival::not_finite, "bad_commands"},
                                         Lie{"wrong_shape", Arrival::wrong_shape, "bad_commands"},
                                         Lie{"old_observation", Arrival::expired_observation, "command_lost"},
                                         Lie{"future_observation", Arrival::future_observation, "bad_commands"},
                                         Lie{"repeated_sequence", Arrival::repeated_sequence, "bad_commands"},
                                         Lie{"out_of_range", Arrival::none, "bad_commands"},
                                         Lie{"wrong_policy", Arrival::wrong_policy, "bad_commands"},
                                         Lie{"random_bytes", Arrival::none, "damped_stop"},
                                         Lie{"frozen", Arrival::none, "command_lost"},
                                         Lie{"torn", Arrival::none, "command_lost"}),
                         [](const testing::TestParamInfo<Lie>& lie) { return std::string(lie.param.when); });

// 82 KB and more than one message per tick for some 2000 ticks: what was recorded before is still there, every tick can
// be judged, and the folder has not grown by what was refused.
// Threat: policy-floods
TEST(LyingPolicy, AFloodOfRefusedMessagesErasesNoEvidence) {
  RunningRobot robot;
  const Child rogue = robot.start_rogue("flood", "2 s");
  arm_and_track(robot);
  ASSERT_TRUE(robot.wait_for_mode(Mode::damped_stop)) << robot.logs();
  robot.let_run(2000);
  const auto arrived = [](const StatusSnapshot& s, Arrival as) { return s.arrivals[static_cast<std::size_t>(as)]; };
  const auto status = robot.wait_until([&](const StatusSnapshot& s) {
    return arrived(s, Arrival::wrong_shape) > 100 && arrived(s, Arrival::not_finite) > 100;
  });
  ASSERT_TRUE(status.has_value());
  EXPECT_GT(arrived(status->status, Arrival::wrong_shape), 100U);
  EXPECT_GT(arrived(status->status, Arrival::not_finite), 100U);
  expect_sound_evidence(robot, "bad_commands");
  EXPECT_EQ(text_of(robot.run_directory() + "/manifest.json").find("\"command "), std::string::npos) << "lost commands";
  EXPECT_LT(std::filesystem::file_size(robot.run_directory() + "/ticks.mcap"), std::uintmax_t{24} << 20U);
}

TEST(LyingPolicy, BackwardStampsAreCountedAsIntegrationErrors) {
  RunningRobot robot;
  const Child rogue = robot.start_rogue("backward_stamps", "2 s");
  arm_and_track(robot);
  const auto status = robot.wait_until([](const StatusSnapshot& s) { return s.tick.integration_errors > 0; });
  ASSERT_TRUE(status.has_value());
  EXPECT_GT(status->status.tick.integration_errors, 0U);
  ASSERT_TRUE(robot.finish()) << robot.logs();
}

}  // namespace
}  // namespace takt::test
