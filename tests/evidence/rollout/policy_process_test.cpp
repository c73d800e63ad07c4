// SPDX-License-Identifier: Apache-2.0
// Goal: a policy that is a program rolls out in virtual time as a network does: shown virtual time alone, the same
// bytes every time, forgetting between rollouts, crashing with the perturbation; and one that skips, ends, hangs or
// does not fit is what it would be on the robot. Method: the demo arm under client_policy, a program on takt/client.h,
// and under takt-policy-host, which knows no virtual time; rollouts of a few seconds.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "evidence/rollout/rollout.hpp"
#include "lab/panel/panel_plan.hpp"
#include "lab/panel/worker_pool.hpp"
#include "tests/evidence/rollout/arm_rollouts.hpp"

namespace takt::lab {
namespace {

using testing::AllOf;
using testing::HasSubstr;
constexpr evidence::PolicyProcess::Patience kPatience{seconds(60), seconds(60)};

std::string program(const std::string& what, int number = 0) {
  return std::string(TAKT_CLIENT_POLICY) + " " + what + " " + std::to_string(number);
}

struct Rolled {
  evidence::RolloutRow row;
  std::string silence;
  std::uint64_t played = 0;  // ticks in which a command was in use
  std::uint64_t oldest_ms = 0;
};

Rolled roll(evidence::PolicyProcess& policy, std::string_view perturbation = "none", std::uint64_t seed = 1) {
  const evidence::RolloutSetup like = test::setup(perturbation, seed);
  Rolled rolled;
  const evidence::RolloutSetup setup{.robot = like.robot,
                                     .policy = policy,
                                     .policy_hash = like.policy_hash,
                                     .timing = {},
                                     .perturbation = like.perturbation,
                                     .seed = seed,
                                     .duration = like.duration,
                                     .scored = like.scored,
                                     .bound_m = 10,
                                     .on_tick =
                                         [&](const TickRecord& record) {
                                           if (record.header.mode != Mode::tracking) return;
                                           ++rolled.played;
                                         },
                                     .on_silence = [&](const std::string& why) { rolled.silence = why; }};
  if (const auto done = evidence::run_rollout(setup, rolled.row); !done) throw std::runtime_error(done.error());
  return rolled;
}

TEST(PolicyProcess, RollsOutTheSameEveryTimeInOneProcessAndInAnother) {
  evidence::PolicyProcess policy(program("sways"), kPatience), another(program("sways"), kPatience);
  const Rolled first = roll(policy), second = roll(policy), other = roll(another);
  EXPECT_EQ(first.silence, "");
  EXPECT_EQ(first.row.final_mode, Mode::tracking);
  EXPECT_GT(first.played, 4000U) << "of 5000 ticks";
  EXPECT_EQ(first.row.replay_hash, second.row.replay_hash) << "a rollout before it left something behind";
  EXPECT_EQ(first.row.replay_hash, other.row.replay_hash);
  EXPECT_NE(first.row.replay_hash, roll(policy, "none", 2).row.replay_hash) << "the seed decides nothing";
  // The model's 8 ms of inference, half a period of waiting, half of holding; not what the program really took.
  EXPECT_GT(first.row.age_per_tick.total.p50_ms.value_or(0), 10);
  EXPECT_LT(first.row.age_per_tick.total.p99_ms.value_or(1e9), 100);
}

TEST(PolicyProcess, PerturbationsReachItAsTheyReachANetwork) {
  evidence::PolicyProcess policy(program("sways"), kPatience);
  const Rolled frozen = roll(policy, "policy_freeze");
  EXPECT_GT(frozen.row.safety.entered_degraded, 0U);
  const Rolled crashed = roll(policy, "policy_crash"), again = roll(policy, "policy_crash");
  EXPECT_EQ(crashed.silence, "");
  EXPECT_GT(crashed.row.safety.entered_degraded, 0U);
  EXPECT_EQ(crashed.row.replay_hash, again.row.replay_hash);
}

TEST(PolicyProcess, WhoHasNoAnswerHasNone) {
  evidence::PolicyProcess policy(program("skips", 3), kPatience);
  const Rolled some = roll(policy), again = roll(policy);
  EXPECT_EQ(some.silence, "");
  EXPECT_EQ(some.row.final_mode, Mode::tracking) << "two answers of three are enough";
  EXPECT_EQ(some.row.replay_hash, again.row.replay_hash);
  evidence::PolicyProcess never(program("skips", 1), kPatience);
  const Rolled none = roll(never);
  EXPECT_EQ(none.silence, "") << "saying nothing is no hanging";
  EXPECT_EQ(none.played, 0U);
}

TEST(PolicyProcess, OneThatEndsOrHangsIsSilentFromThenOnAndStartedAnewForTheNext) {
  evidence::PolicyProcess ends(program("exits", 100), kPatience);
  const Rolled ended = roll(ends);
  EXPECT_THAT(ended.silence, AllOf(HasSubstr("exited with 3"), HasSubstr("in the middle of a rollout")));
  EXPECT_GT(ended.row.safety.entered_damped_stop, 0U);
  EXPECT_GT(ended.played, 0U);
  EXPECT_EQ(roll(ends).row.replay_hash, ended.row.replay_hash);

  evidence::PolicyProcess hangs(program("hangs", 100), {seconds(60), milliseconds(300)});
  const Rolled hung = roll(hangs);
  EXPECT_THAT(hung.silence, HasSubstr("did not answer an observation"));
  EXPECT_EQ(hung.row.replay_hash, ended.row.replay_hash) << "to the robot it is the same";
}

TEST(PolicyProcess, OneThatDoesNotFitIsRefusedBeforeAnythingRolls) {
  const auto why = [](const std::string& command) {
    evidence::PolicyProcess policy(command, kPatience);
    const auto begun = policy.begin(test::arm(), test::setup().policy_hash);
    return begun ? std::string("taken") : begun.error();
  };
  EXPECT_THAT(why(program("steps", 12)), HasSubstr("exited with 65 before it took the policy's place"));
  EXPECT_THAT(why("/no/such/program"), HasSubstr("exited with 127"));
  evidence::PolicyProcess host(TAKT_POLICY_HOST, {seconds(2), seconds(2)});
  EXPECT_FALSE(host.begin(test::arm(), test::setup().policy_hash)) << "takt-policy-host knows no virtual time";
}

// Threat: policy-leaves-process
TEST(PolicyProcess, IsBehindTheBoundaryAndLeavesNoProcess) {
  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) / ("takt-touched." + std::to_string(getpid()));
  const std::string mark = "4321" + std::to_string(getpid());
  const auto leaves = [&](const policy_host::Grants& grants) {
    evidence::PolicyProcess policy("touch " + file.string() + "; setsid -f sleep " + mark + "; " + program("sways"),
                                   kPatience, grants);
    const auto begun = policy.begin(test::arm(), test::setup().policy_hash);
    EXPECT_TRUE(begun) << begun.error();
    return std::filesystem::remove(file);
  };
  EXPECT_FALSE(leaves({}));
  EXPECT_TRUE(leaves({.writable = {testing::TempDir()}}));
  EXPECT_TRUE(leaves({.everything = true}));
  EXPECT_NE(
      std::system(
          ("pgrep -f 'sleep " + mark.substr(0, 1) + "[" + mark.substr(1, 1) + "]" + mark.substr(2) + "'").c_str()),
      0);
}

std::vector<std::string> hashes(std::size_t workers) {
  Panel panel = load_panel("config/panels/smoke.yaml").value();
  panel.perturbations.resize(3);
  auto contest = Contest::prepare(std::move(panel), {.policy = program("sways")});
  if (!contest) throw std::runtime_error(contest.error());
  std::vector<std::string> found;
  const auto done = run_in_workers(*contest, plan_of(contest->panel(), {}), workers, [&](const RanRollout& ran) {
    found.push_back(ran.row.replay_hash);
    return std::expected<void, std::string>();
  });
  EXPECT_TRUE(done) << done.error();
  return found;
}

TEST(PolicyProcess, PanelsRollItOutInAnyNumberOfWorkersAndLeaveNothingBehind) {
  const std::filesystem::path place =
      std::filesystem::path(testing::TempDir()) / ("takt-place." + std::to_string(getpid()));
  std::filesystem::create_directory(place);
  setenv("TMPDIR", place.c_str(), 1);
  const std::vector<std::string> one = hashes(1), two = hashes(2);
  unsetenv("TMPDIR");
  EXPECT_EQ(one.size(), 3U);
  EXPECT_EQ(one, two);
  EXPECT_TRUE(std::filesystem::is_empty(place)) << *std::filesystem::directory_iterator(place);
  std::filesystem::remove_all(place);
}

TEST(PolicyProcess, APanelIsRefusedWhereTheProgramDoesNotTakeTheRobot) {
  Panel panel = load_panel("config/panels/smoke.yaml").value();
  const auto refused = Contest::prepare(panel, {.policy = program("steps", 12)});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error(), HasSubstr("method takt: policy `"));
  panel.tasks[0].modes = 2;
  EXPECT_THAT(Contest::prepare(panel, {.policy = program("sways")}).error(), HasSubstr("leave out one"));
}

}  // namespace
}  // namespace takt::lab
