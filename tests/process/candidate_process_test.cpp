// SPDX-License-Identifier: Apache-2.0
// Goal: another policy runs beside the one in charge of a live robot, takes its place and gives it back by the commands
// that people use; a host killed in its place leaves the other one in charge and the robot tracking; the record says
// who moved it, and replays. Method: the demo arm and a copy of its network under another hash, real processes on the
// loopback bus; the run folder is judged afterwards.
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "config/load.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/process/sent_frames.hpp"
#include "tests/support/files.hpp"

namespace takt::test {
namespace {

// The same network, and another file: with a doc_string (ONNX: field 6 of ModelProto) behind it.
std::string retrained() {
  std::string path = testing::TempDir() + "takt-retrained.onnx";
  std::ofstream(path, std::ios::binary) << text_of("config/arm6_reach.onnx") << "\x32\x09retrained";
  return path;
}

std::uint64_t hash_of(const std::string& file) {
  return config::policy_hash(file).value();
}

class CandidateProcess : public testing::Test {
 protected:
  Child shadow(const std::string& file) {
    return Child(
        {"takt", "policy", "shadow", file, "--robot", robot_.robot_file(), "--runtime-dir", robot_.directory()},
        robot_.directory() + "/shadow.log");
  }
  bool ask(const std::string& word) const { return robot_.takt({"policy", word, "--runtime-dir", robot_.directory()}); }
  bool wait_for_fresh_candidate() const {
    return robot_
        .wait_until([](const StatusSnapshot& s) {
          return s.policy_pids[Seat::candidate] != 0 && s.tick.seats[Seat::candidate].freshness == Freshness::fresh;
        })
        .has_value();
  }
  [[nodiscard]] CandidateRecord candidate() const { return robot_.status()->status.tick.candidate; }
  std::string run_takt(const std::string& word) {
    const std::string log = robot_.directory() + "/" + word + ".log";
    Child child({"takt", word, robot_.run_directory()}, log);
    EXPECT_EQ(child.wait(std::chrono::seconds(60)), 0) << text_of(log);
    return text_of(log);
  }

  RunningRobot robot_;
};

TEST_F(CandidateProcess, ShadowSwapBackAndAKillInBetween) {
  const std::string file = retrained();
  Child policy = robot_.start_policy_host();
  ASSERT_EQ(robot_.arm(), "") << robot_.logs();
  ASSERT_TRUE(robot_.wait_for_mode(Mode::tracking)) << robot_.logs();
  EXPECT_FALSE(ask("swap")) << "nobody runs beside it";
  EXPECT_FALSE(ask("back")) << "it is in charge";

  Child beside = shadow(file);
  ASSERT_TRUE(wait_for_fresh_candidate()) << robot_.logs() << text_of(robot_.directory() + "/shadow.log");
  EXPECT_EQ(candidate().policy_hash, hash_of(file));
  EXPECT_EQ(robot_.status()->status.tick.command_policy, hash_of("config/arm6_reach.onnx"));
  ASSERT_TRUE(ask("swap")) << robot_.logs();
  EXPECT_EQ(candidate().in_charge, 1);
  EXPECT_TRUE(robot_.wait_until([&](const StatusSnapshot& s) { return s.tick.command_policy == hash_of(file); }));
  ASSERT_TRUE(ask("back")) << robot_.logs();
  EXPECT_EQ(candidate().in_charge, 0);

  ASSERT_TRUE(ask("swap")) << robot_.logs();
  kill(static_cast<pid_t>(robot_.status()->status.policy_pids[Seat::candidate]), SIGKILL);
  EXPECT_TRUE(robot_.wait_until([](const StatusSnapshot& s) { return s.tick.candidate.in_charge == 0; }));
  EXPECT_EQ(beside.wait(std::chrono::seconds(20)), 1);
  EXPECT_NE(text_of(robot_.directory() + "/shadow.log").find("killed by SIGKILL"), std::string::npos);
  robot_.let_run(500);
  EXPECT_EQ(robot_.status()->status.tick.mode, Mode::tracking) << robot_.logs();

  ASSERT_TRUE(robot_.finish()) << robot_.logs();
  const SentFrames frames = judge_sent_frames(robot_.run_directory(), config::load(robot_.robot_file()).value());
  EXPECT_GT(frames.motion_commands, 1000U);
  EXPECT_EQ(frames.first_violation, "");
  run_takt("replay");
  const std::string report = run_takt("report");
  for (const char* const said : {"swapped: candidate", "back: the robot's own policy is in charge", "back_for_age"})
    EXPECT_NE(report.find(said), std::string::npos) << said << "\n" << report;
  EXPECT_NE(text_of(robot_.directory() + "/executive.log").find("change of policy: back_for_age"), std::string::npos);
}

// Goal: no process takes another candidate's figures for its own. Method: a second one beside the first.
TEST_F(CandidateProcess, ASecondOneIsRefusedAndTheFirstGoesOn) {
  Child policy = robot_.start_policy_host();
  ASSERT_TRUE(robot_.wait_until(
      [](const StatusSnapshot& s) { return s.tick.seats[Seat::policy].freshness == Freshness::fresh; }));
  Child first = shadow(retrained());
  ASSERT_TRUE(wait_for_fresh_candidate()) << robot_.logs();
  const std::string log = robot_.directory() + "/second.log";
  Child second({"takt", "policy", "shadow", "config/arm6_reach.onnx", "--robot", robot_.robot_file(), "--runtime-dir",
                robot_.directory()},
               log);
  EXPECT_EQ(second.wait(std::chrono::seconds(20)), 1);
  EXPECT_NE(text_of(log).find("a candidate runs already, pid " +
                              std::to_string(robot_.status()->status.policy_pids[Seat::candidate])),
            std::string::npos)
      << text_of(log);
  EXPECT_EQ(robot_.status()->status.tick.seats[Seat::candidate].freshness, Freshness::fresh);
  first.signal(SIGINT);
  EXPECT_EQ(first.wait(std::chrono::seconds(20)), 0);
  EXPECT_TRUE(robot_.finish());
}

// Ctrl-C takes no policy from the robot that is in charge of it.
TEST_F(CandidateProcess, EndingTheShadowGivesTheRobotBackFirst) {
  Child policy = robot_.start_policy_host();
  ASSERT_EQ(robot_.arm(), "") << robot_.logs();
  ASSERT_TRUE(robot_.wait_for_mode(Mode::tracking)) << robot_.logs();
  Child beside = shadow(retrained());
  ASSERT_TRUE(wait_for_fresh_candidate()) << robot_.logs();
  ASSERT_TRUE(ask("swap")) << robot_.logs();
  beside.signal(SIGINT);
  EXPECT_EQ(beside.wait(std::chrono::seconds(20)), 0);
  EXPECT_EQ(candidate().in_charge, 0);
  EXPECT_NE(text_of(robot_.directory() + "/shadow.log").find("back: the robot's own policy is in charge"),
            std::string::npos);
  EXPECT_EQ(robot_.status()->status.tick.mode, Mode::tracking) << robot_.logs();
  EXPECT_TRUE(robot_.finish());
}

// Goal: a candidate of one's own is kept off the executive's processor too. Method: one that says where it may run.
TEST_F(CandidateProcess, AProgramOfOnesOwnIsKeptOffTheExecutivesProcessor) {
  constexpr int kControlCpu = 1;  // of the demo robot
  cpu_set_t mine;
  if (sched_getaffinity(0, sizeof mine, &mine) != 0 || CPU_COUNT(&mine) < 2 || !CPU_ISSET(kControlCpu, &mine))
    GTEST_SKIP() << "NOT TESTED: needs processor 1 and another";
  Child policy = robot_.start_policy_host();
  ASSERT_TRUE(robot_.wait_until(
      [](const StatusSnapshot& s) { return s.tick.seats[Seat::policy].freshness == Freshness::fresh; }));
  const std::string program = robot_.directory() + "/candidate.py";
  std::ofstream(program) << "#!/usr/bin/python3\nimport os\nprint('may run on 1:', 1 in os.sched_getaffinity(0))\n";
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  Child beside({"takt", "policy", "shadow", retrained(), "--robot", robot_.robot_file(), "--runtime-dir",
                robot_.directory(), "--policy-host", program},
               robot_.directory() + "/shadow.log");
  EXPECT_EQ(beside.wait(std::chrono::seconds(30)), 1);
  const std::string said = text_of(robot_.directory() + "/shadow.log");
  EXPECT_NE(said.find("may run on 1: False"), std::string::npos) << said;
  EXPECT_TRUE(robot_.finish());
}

TEST_F(CandidateProcess, APolicyThatDoesNotFitIsRefusedBesideToo) {
  Child policy = robot_.start_policy_host();
  ASSERT_TRUE(robot_.wait_until(
      [](const StatusSnapshot& s) { return s.tick.seats[Seat::policy].freshness == Freshness::fresh; }));
  Child beside = shadow("config/cart_pole_balance.onnx");
  EXPECT_EQ(beside.wait(std::chrono::seconds(30)), 1);
  const std::string said = text_of(robot_.directory() + "/shadow.log");
  EXPECT_NE(said.find("the candidate's host exited with 65"), std::string::npos) << said;
  EXPECT_TRUE(robot_.finish());
}

}  // namespace
}  // namespace takt::test
