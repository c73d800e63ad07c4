// SPDX-License-Identifier: Apache-2.0
// Goal: the watches over feedback, following and IMU suspect no healthy robot, and it is known by how much they miss.
// Method: nominal, pushed and laden rollouts of every shipped robot and of the published walkers, in virtual time; of
// every tick the watches' own margins, computed anew from its record.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <string>

#include "config/load.hpp"
#include "evidence/rollout/rollout.hpp"
#include "executive/pipeline/following.hpp"
#include "executive/pipeline/joint_watch.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "policy_host/onnx_policy.hpp"
#include "tests/evidence/rollout/published_g1.hpp"
#include "tests/support/shared_files.hpp"

namespace takt::lab {
namespace {

constexpr pipeline::CauseMask kWatches =
    pipeline::bit(Cause::feedback_implausible) | pipeline::bit(Cause::following_error) | pipeline::bit(Cause::imu_lost);

class Margins {
 public:
  explicit Margins(const config::RobotConfig& robot) : config_(setup::tick_config_of(robot, 1)) {}

  void begin() { joints_ = {}; }
  void take(const TickRecord& record) {
    ++ticks;
    alarms += (record.header.causes_active & kWatches) != 0 ? 1U : 0U;
    for (std::size_t j = 0; j < config_.joint_count; ++j) {
      Joint& joint = joints_.at(j);
      const JointRecord& now = record.joints[j];
      const pipeline::JointConfig& known = config_.joints[j];
      pipeline::take_feedback(joint.watch, now.feedback, record.header.now, known, config_);
      const bool is_driven = now.feedback.drive_state == DriveState::enabled;
      if (is_driven)
        pipeline::note_told(joint.watch,
                            {now.q_command, now.dq_command, now.kp_command, now.kd_command, now.tau_command},
                            now.tau_gravity, now.q_reference, known);
      else
        pipeline::note_untold(joint.watch);
      const pipeline::FeedbackMargin margin = pipeline::margin_of(joint.watch, known, config_);
      contradiction = std::max(contradiction, margin.contradiction);
      frozen = std::max(frozen, margin.frozen);
      note_following(joint, now, known, record.header.now);
    }
  }

  std::uint64_t ticks = 0, alarms = 0;
  // Largest shares of the limits; of following: the longest time beyond its limit at one go, of its time-out.
  float contradiction = 0, frozen = 0, following = 0;
  double behind_for = 0;

 private:
  struct Joint {
    pipeline::JointWatch watch;
    pipeline::JointState state;
    MonoTime behind_since;
  };
  void note_following(Joint& joint, const JointRecord& now, const pipeline::JointConfig& known, MonoTime at) {
    const float share = pipeline::following_share(joint.state, now.q_estimate, known);
    following = std::max(following, share);
    if (share <= 1.0F)
      joint.behind_since = {};
    else if (!joint.behind_since.is_set())
      joint.behind_since = at;
    if (joint.behind_since.is_set())
      behind_for = std::max(behind_for, (at - joint.behind_since).seconds() / config_.following.timeout.seconds());
    const bool is_stiff = now.feedback.drive_state == DriveState::enabled;
    joint.state.kp_before = is_stiff ? known.kp : 0.0F;
    joint.state.reference.q = static_cast<double>(now.q_reference);
  }

  pipeline::TickConfig config_;
  std::array<Joint, kMaxJoints> joints_{};
};

struct Trouble {
  std::string_view what;
  double dose;
};
struct Walk {
  const char* name;
  evidence::Task task;
  double push_N, payload_kg;
  const test::Published* published = nullptr;
};

class WatchMargins : public testing::TestWithParam<Walk> {};

TEST_P(WatchMargins, SuspectNothingInHealthyRobots) {
  const Walk& walk = GetParam();
  std::string file = "config/" + std::string(walk.name) + ".yaml";
  if (walk.published != nullptr) {
    TAKT_NEEDS_SHARED(test::kG1Model, walk.published->deploy, walk.published->network);
    file = testing::TempDir() + "takt-margins-" + std::to_string(getpid()) + ".yaml";
    test::import_g1(file, *walk.published);
  }
  const auto robot = config::load(file);
  if (walk.published != nullptr) std::remove(file.c_str());
  ASSERT_TRUE(robot) << robot.error();
  const auto& known = *robot->policy;
  const auto policy = policy_host::load_onnx_policy(known.file, known.input, known.output);
  ASSERT_TRUE(policy) << policy.error();
  const auto fallback = evidence::load_fallback_host(*robot);
  ASSERT_TRUE(fallback) << fallback.error();
  Margins margins(*robot);
  const Trouble troubles[] = {{"none", 0}, {"push", walk.push_N}, {"payload", walk.payload_kg}};
  for (const Trouble& trouble : troubles) {
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      margins.begin();
      evidence::RolloutRow row;
      const auto done =
          evidence::run_rollout({.robot = *robot,
                                 .policy = **policy,
                                 .policy_hash = 1,
                                 .fallback = fallback->get(),
                                 .task = walk.task,
                                 .timing = {},
                                 .perturbation = {evidence::find_perturbation(trouble.what)->as<evidence::Trouble>(),
                                                  trouble.dose, seconds(4), seconds(2)},
                                 .seed = seed,
                                 .duration = seconds(8),
                                 .scored = seconds(2),
                                 .bound_m = 0.4,
                                 .on_tick = [&](const TickRecord& record) { margins.take(record); }},
                                row);
      ASSERT_TRUE(done) << done.error();
      EXPECT_TRUE(row.success) << trouble.what << ", seed " << seed << ": " << row.failure_label;
    }
  }
  EXPECT_GT(margins.ticks, 6'000U);
  EXPECT_EQ(margins.alarms, 0U);
  std::printf(
      "%-16s %6llu ticks: contradiction %.2f, frozen %.2f, following %.2f of their limits; beyond following_error for "
      "%.2f of its time-out\n",
      walk.name, static_cast<unsigned long long>(margins.ticks), double{margins.contradiction}, double{margins.frozen},
      double{margins.following}, margins.behind_for);
}

INSTANTIATE_TEST_SUITE_P(Robots, WatchMargins,
                         testing::Values(Walk{"arm6", evidence::Task::arm_tracking, 30, 0.5},
                                         Walk{"dual_arm12", evidence::Task::arm_tracking, 30, 0.5},
                                         Walk{"arm6_visuomotor", evidence::Task::arm_tracking, 30, 0.5},
                                         Walk{"cart_pole", evidence::Task::cart_pole_balance, 0.2, 0.01},
                                         Walk{"balancer", evidence::Task::base_velocity, 20, 1},
                                         Walk{"g1", evidence::Task::base_velocity, 100, 1, &test::kG1Walker},
                                         Walk{"g1_mjlab", evidence::Task::base_velocity, 100, 1, &test::kG1OfMjlab}),
                         [](const auto& walk) { return std::string(walk.param.name); });

}  // namespace
}  // namespace takt::lab
