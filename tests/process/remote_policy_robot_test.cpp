// SPDX-License-Identifier: Apache-2.0
// Goal: a whole robot under a policy on another machine is as safe as under one beside it: through a bad network it
// tracks, and when the network is cut it degrades, stops, and stays stopped when the network comes back; no frame
// leaves the envelope, and the run replays. Method: the demo arm in real processes; its policy behind
// takt-policy-bridge and takt-policy-server in two network namespaces with a faulty wire between them.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "monitor/judge/run_metrics.hpp"
#include "monitor/record/recorded_run.hpp"
#include "tests/process/faulty_network.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/process/sent_frames.hpp"
#include "tests/support/files.hpp"

namespace takt::test {
namespace {

class RemotePolicyRobot : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string why = FaultyNetwork::why_not(); !why.empty())
      GTEST_SKIP() << "NO ROBOT UNDER A POLICY ON ANOTHER MACHINE WAS TESTED: " << why;
    network_.emplace();
    file_ = testing::TempDir() + "takt-remote-" + std::to_string(getpid()) + ".yaml";
    std::string text = text_of("config/arm6.yaml");
    const std::string policy = "file: arm6_reach.onnx";
    text.replace(text.find(policy), policy.size(),
                 "file: " + (std::filesystem::current_path() / "config/arm6_reach.onnx").string());
    std::ofstream(file_) << text
                         << "\ndds: { interface: takt0, peers: [{ address: 10.77.0.1 }, { address: 10.77.0.2 }] }\n";
    robot_.emplace("", file_);
    far_ = robot_->directory() + "/far";
    std::filesystem::create_directories(far_);
    bridge_.emplace(start(0, "takt-policy-bridge", robot_->directory()));
    server_.emplace(start(1, "takt-policy-server", far_));
    host_.emplace(start(1, "takt-policy-host", far_));
    ASSERT_EQ(robot_->arm(), "") << robot_->logs();
    ASSERT_TRUE(robot_->wait_for_mode(Mode::tracking)) << robot_->logs();
  }
  void TearDown() override { std::filesystem::remove(file_); }
  Child start(int side, const std::string& program, const std::string& directory) {
    return network_->start(side, {program, "--robot", robot_->robot_file(), "--runtime-dir", directory},
                           robot_->directory() + "/" + program + ".log");
  }
  void expect_sound() {
    ASSERT_TRUE(robot_->finish()) << robot_->logs();
    const SentFrames frames = judge_sent_frames(robot_->run_directory(), config::load(file_).value());
    EXPECT_GT(frames.motion_commands, 1000U) << "the robot never moved: nothing was tested";
    EXPECT_EQ(frames.first_violation, "");
    Child replay({"takt", "replay", robot_->run_directory()}, robot_->directory() + "/replay.log");
    EXPECT_EQ(replay.wait(std::chrono::seconds(60)), 0) << text_of(robot_->directory() + "/replay.log");
  }

  std::string file_, far_;
  std::optional<FaultyNetwork> network_;
  std::optional<RunningRobot> robot_;
  std::optional<Child> bridge_, server_, host_;
};

TEST_F(RemotePolicyRobot, CutOffItDegradesStopsAndStaysStopped) {
  robot_->let_run(1500);
  network_->set({.delay = {}, .jitter = {}, .loss = 0, .twice = 0, .is_cut = true});
  ASSERT_TRUE(robot_->wait_for_mode(Mode::damped_stop)) << robot_->logs();
  network_->set({});
  robot_->let_run(500);
  EXPECT_EQ(robot_->status()->status.tick.mode, Mode::damped_stop) << "what latched waits for a person";
  ASSERT_TRUE(robot_->reset()) << robot_->logs();
  ASSERT_EQ(robot_->arm(), "") << robot_->logs();
  ASSERT_TRUE(robot_->wait_for_mode(Mode::tracking)) << "with the network back it can go on: " << robot_->logs();
  expect_sound();
  const std::string transitions = text_of(robot_->run_directory() + "/transitions.jsonl");
  const std::size_t degraded = transitions.find("degraded"), stopped = transitions.find("command_lost");
  EXPECT_LT(degraded, stopped) << transitions;
  EXPECT_NE(stopped, std::string::npos) << transitions;
  // The run alone says which part failed, and whose commands moved the robot.
  const auto run = monitor::open_run(robot_->run_directory());
  ASSERT_TRUE(run) << run.error();
  const auto metrics = monitor::metrics_of(*run);
  ASSERT_TRUE(metrics) << metrics.error();
  const auto lost = std::ranges::find(metrics->incidents, Cause::command_lost, &incident::Incident::cause);
  ASSERT_NE(lost, metrics->incidents.end());
  EXPECT_NE(lost->sentence.find("is not heard, nor is its machine: the network to it failed"), std::string::npos)
      << lost->sentence;
  ASSERT_FALSE(metrics->command_sources.empty());
  EXPECT_EQ(metrics->command_sources[0].what.find("policy server "), 0U) << metrics->command_sources[0].what;
  EXPECT_EQ(metrics->command_sources[0].first_sequence, 1U);
}

TEST_F(RemotePolicyRobot, TracksThroughDelayJitterAndLoss) {
  network_->set({.delay = milliseconds(10), .jitter = milliseconds(20), .loss = 0.05, .twice = 0.05});
  robot_->let_run(2000);
  EXPECT_TRUE(robot_->wait_for_mode(Mode::tracking)) << robot_->logs();
  expect_sound();
}

}  // namespace
}  // namespace takt::test
