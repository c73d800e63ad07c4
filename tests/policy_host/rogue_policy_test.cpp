// SPDX-License-Identifier: Apache-2.0
// Goal: the liar that other tests rely on tells exactly the lie it was asked for, after an honest start. Method: the
// real program against an executive of ours that publishes observations and looks into the command mailbox.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "tests/policy_host/fake_server.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

constexpr char kRobot[] = "config/arm6.yaml";
constexpr Duration kLimit = seconds(30);

class Rogue {
 public:
  Rogue(const char* behaviour, const std::string& directory) : pid_(fork()) {
    if (pid_ != 0) return;
    execl(TAKT_ROGUE_POLICY, "takt-rogue-policy", "--robot", kRobot, "--runtime-dir", directory.c_str(), "--behaviour",
          behaviour, "--healthy-for", "200 ms", nullptr);
    _exit(127);
  }
  Rogue(const Rogue&) = delete;
  Rogue& operator=(const Rogue&) = delete;
  ~Rogue() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  [[nodiscard]] bool died_by(int signal) {
    int status = 0;
    if (waitpid(pid_, &status, WNOHANG) != pid_) return false;
    pid_ = -1;
    return WIFSIGNALED(status) && WTERMSIG(status) == signal;
  }

 private:
  pid_t pid_;
};

struct Seen {
  ipc::ReadStatus status = ipc::ReadStatus::nothing_new;
  CommandChunk chunk;
  CommandHeader before;         // of the previous fresh chunk
  std::uint64_t newest_id = 0;  // published by the executive
  std::uint64_t honest_hash = 0;
  int silent = 0;  // observations in a row without a command
  bool killed = false;
  [[nodiscard]] bool fresh() const { return status == ipc::ReadStatus::fresh; }
};

struct Lie {
  const char* name;
  std::function<bool(const Seen&)> is_told;
  friend void PrintTo(const Lie& lie, std::ostream* out) { *out << lie.name; }
};

bool is_honest(const Seen& seen, const config::RobotConfig& robot) {
  const CommandHeader& header = seen.chunk.header;
  const auto values = std::span(seen.chunk.values).first(seen.chunk.value_count());
  return seen.fresh() && header.step_count == robot.policy->steps && header.joint_count == robot.joints.size() &&
         header.observation_id <= seen.newest_id && header.sequence > seen.before.sequence &&
         header.dequeued_at <= header.infer_started_at && header.infer_started_at <= header.infer_ended_at &&
         header.infer_ended_at <= header.published_at &&
         std::ranges::all_of(values, [](float q) { return std::abs(q) < 3.0F; });
}

class RoguePolicy : public testing::TestWithParam<Lie> {};

TEST_P(RoguePolicy, IsHonestFirstAndThenTellsItsLie) {
  const auto robot = config::load(kRobot);
  ASSERT_TRUE(robot) << robot.error();
  const auto hash = config::policy_hash(robot->policy->file);
  ASSERT_TRUE(hash) << hash.error();
  const test::TemporaryDirectory directory;
  FakeExecutive executive(config::executive_socket(directory.path()));
  Rogue rogue(GetParam().name, directory.path());

  Observation observation;
  observation.joint_count = 6;
  observation.period = milliseconds(5);
  Seen seen;
  seen.honest_hash = *hash;
  bool honest = false, lied = false;
  for (const MonoTime end = monotonic_now() + kLimit; !lied && monotonic_now() < end;) {
    seen.newest_id = ++observation.id;
    observation.published_at = monotonic_now();
    executive.publish(observation);
    sleep_until(monotonic_now() + milliseconds(5));
    if (!executive.acknowledged()) continue;
    seen.before = seen.fresh() ? seen.chunk.header : seen.before;
    seen.status = executive.look(seen.chunk).status;
    seen.silent = seen.fresh() ? 0 : seen.silent + 1;
    seen.killed = seen.killed || rogue.died_by(SIGKILL);
    honest = honest || (is_honest(seen, *robot) && seen.chunk.header.policy_hash == seen.honest_hash);
    lied = honest && GetParam().is_told(seen);
  }
  EXPECT_TRUE(honest) << "never a valid chunk";
  EXPECT_TRUE(lied) << "the lie was never told";
}

const auto value = [](const Seen& seen, std::size_t i) { return seen.chunk.values[i]; };

INSTANTIATE_TEST_SUITE_P(
    EveryLie, RoguePolicy,
    testing::Values(
        Lie{"nan", [](const Seen& seen) { return seen.fresh() && std::isnan(value(seen, 0)); }},
        Lie{"inf",
            [](const Seen& seen) { return seen.fresh() && std::isinf(value(seen, seen.chunk.value_count() - 1)); }},
        Lie{"wrong_shape", [](const Seen& seen) { return seen.fresh() && seen.chunk.header.step_count == 0; }},
        Lie{"old_observation",
            [](const Seen& seen) { return seen.fresh() && seen.chunk.header.observation_id + 40 < seen.newest_id; }},
        Lie{"future_observation",
            [](const Seen& seen) { return seen.fresh() && seen.chunk.header.observation_id > seen.newest_id; }},
        Lie{"repeated_sequence",
            [](const Seen& seen) { return seen.fresh() && seen.chunk.header.sequence == seen.before.sequence; }},
        Lie{"random_bytes",
            [](const Seen& seen) {
              return seen.status == ipc::ReadStatus::contended || seen.status == ipc::ReadStatus::corrupt;
            }},
        Lie{"out_of_range", [](const Seen& seen) { return seen.fresh() && value(seen, 0) > 50.0F; }},
        Lie{"wrong_policy",
            [](const Seen& seen) {
              // Twice in a row: one that alternates with the truth keeps the robot going.
              const std::uint64_t wrong = seen.honest_hash ^ 1U;
              return seen.fresh() && seen.chunk.header.policy_hash == wrong && seen.before.policy_hash == wrong;
            }},
        Lie{"backward_stamps",
            [](const Seen& seen) {
              return seen.fresh() && seen.chunk.header.infer_ended_at < seen.chunk.header.infer_started_at;
            }},
        Lie{"frozen", [](const Seen& seen) { return !seen.killed && seen.silent > 100; }},
        Lie{"torn", [](const Seen& seen) { return seen.killed && seen.silent > 10; }},
        Lie{"flood",
            [](const Seen& seen) {
              return seen.fresh() && seen.chunk.header.sequence > seen.newest_id &&
                     std::isnan(value(seen, kMaxChunkValues - 1));
            }}),
    [](const testing::TestParamInfo<Lie>& lie) { return std::string(lie.param.name); });

}  // namespace
}  // namespace takt::policy_host
