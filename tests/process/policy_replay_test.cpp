// SPDX-License-Identifier: Apache-2.0
// Goal: a run of the real programs holds what its network was shown and said, over restarts of the host too; the
// network says it again bit for bit, another one does not, and a byte that was changed afterwards is found. Method: the
// demo arm in real processes; `takt policy replay` judges the run folder, and copies of it that were spoilt.
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "monitor/record/mcap_writer.hpp"
#include "monitor/record/recorded_run.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/support/files.hpp"

namespace takt::test {
namespace {

struct Judged {
  std::optional<int> exit_code;
  std::string output;
  [[nodiscard]] nlohmann::json policy() const { return nlohmann::json::parse(output).at("policies").at(0); }
};

Judged replay_policy(const RunningRobot& robot, const std::string& folder, std::vector<std::string> more = {"--json"}) {
  std::vector<std::string> arguments{"takt", "policy", "replay", folder};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const std::string log = robot.directory() + "/policy-replay.log";
  std::filesystem::remove(log);
  Child replay(arguments, log);
  const auto exit_code = replay.wait(std::chrono::seconds(60));
  return {exit_code, text_of(log)};
}

// The same network but for one weight.
std::string with_another_weight(const std::string& onnx, const std::string& path) {
  std::string bytes = text_of(onnx);
  bytes.at(bytes.size() / 2 / 4 * 4 + 3) ^= '\x01';
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

// Copies what policy replay reads, with one bit of one input changed.
void copy_altered(const std::string& from, const std::string& to) {
  using namespace monitor;
  std::filesystem::create_directory(to);
  for (const char* file : {"config.yaml", "manifest.json"})
    std::filesystem::copy_file(from + "/" + file, to + "/" + file);
  const auto run = open_run(from);
  ASSERT_TRUE(run) << run.error();
  auto writer = McapWriter::create(RunFolder(to).ticks(), 1U << 30U, run_topics(), {});
  ASSERT_TRUE(writer) << writer.error();
  CdrWriter message;
  int count = 0;
  const auto copy = [&](const RecordedPolicyInput& recorded) {
    RecordedPolicyInput input = recorded;
    if (++count == 10) input.input.input.at(3) = -input.input.input.at(3);
    encode_policy_input(input, message);
    writer->write(static_cast<std::uint16_t>(Topic::policy_input), 1, message.bytes());
  };
  (void)scan_run(*run, {.tick = {}, .command = {}, .keyframe = {}, .loss = {}, .policy_input = copy});
  ASSERT_TRUE(writer->finish());
}

TEST(PolicyReplayProcess, ARunIsReplayedThroughItsNetworkAndThroughAnother) {
  RunningRobot robot;
  Child policy = robot.start_policy_host();
  ASSERT_TRUE(robot.wait_until([](const StatusSnapshot& s) {
    return s.tick.seats[Seat::policy].freshness == Freshness::fresh && s.tick.recorded_through != 0;
  }));
  policy.signal(SIGKILL);
  EXPECT_EQ(policy.wait(std::chrono::seconds(20)), 128 + SIGKILL);
  policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  robot.let_run(2000);
  ASSERT_TRUE(robot.finish()) << robot.logs();

  const std::string run = robot.run_directory();
  const Judged same = replay_policy(robot, run);
  ASSERT_EQ(same.exit_code, 0) << same.output;
  const std::uint64_t answers = same.policy().at("answers");
  EXPECT_GT(answers, 50U);
  EXPECT_EQ(same.policy().at("identical"), answers);
  EXPECT_GT(same.policy().at("commands"), answers / 2) << "most answers were read by the executive";
  EXPECT_EQ(same.policy().at("commands"), same.policy().at("commands_as_answered"));
  const std::string text = replay_policy(robot, run, {}).output;
  EXPECT_NE(text.find(std::to_string(answers) + " of " + std::to_string(answers) + " answers reproduce bit for bit"),
            std::string::npos)
      << text;

  const std::string other = with_another_weight("config/arm6_reach.onnx", robot.directory() + "/other.onnx");
  const Judged differs = replay_policy(robot, run, {"--json", "--with", other, "--tolerance", "0"});
  ASSERT_EQ(differs.exit_code, 1) << differs.output;
  EXPECT_LT(differs.policy().at("identical"), answers);
  EXPECT_FALSE(differs.policy().at("first_beyond").is_null());
  const Judged misfit = replay_policy(robot, run, {"--with", "config/cart_pole_balance.onnx"});
  EXPECT_EQ(misfit.exit_code, 65) << misfit.output;

  copy_altered(run, robot.directory() + "/altered");
  const Judged altered = replay_policy(robot, robot.directory() + "/altered");
  EXPECT_EQ(altered.exit_code, 1) << altered.output;
  EXPECT_EQ(altered.policy().at("altered"), 1);
}

TEST(PolicyReplayProcess, ARunThatRecordsNoInputsSaysSo) {
  RunningRobot robot({}, "config/arm6.yaml", {{"record.policy_inputs", "false"}});
  const Child policy = robot.start_policy_host();
  ASSERT_TRUE(robot.wait_until([](const StatusSnapshot& s) {
    return s.tick.seats[Seat::policy].freshness == Freshness::fresh && s.tick.recorded_through != 0;
  }));
  ASSERT_TRUE(robot.finish()) << robot.logs();
  const Judged judged = replay_policy(robot, robot.run_directory(), {});
  EXPECT_EQ(judged.exit_code, 1);
  EXPECT_NE(judged.output.find("has no policy inputs"), std::string::npos) << judged.output;
}

}  // namespace
}  // namespace takt::test
