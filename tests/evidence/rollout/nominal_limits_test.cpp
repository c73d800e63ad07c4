// SPDX-License-Identifier: Apache-2.0
// Goal: in nominal operation the demo robots hardly touch a limit, so that an intervention in a record means something.
// Method: rollouts of the committed robots in virtual time; ticks of joints with a limit among their interventions,
// once the ramp after arming is over.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <string>

#include "config/load.hpp"
#include "evidence/rollout/rollout.hpp"
#include "policy_host/onnx_policy.hpp"

namespace takt::lab {
namespace {

constexpr double kMostTouched = 0.01;  // of the joint-ticks
constexpr InterventionMask kLimits =
    bit(Intervention::position_limit) | bit(Intervention::braking_distance) | bit(Intervention::velocity_limit) |
    bit(Intervention::acceleration_limit) | bit(Intervention::position_barrier) | bit(Intervention::velocity_barrier) |
    bit(Intervention::torque_limit) | bit(Intervention::torque_rate_limit) | bit(Intervention::envelope_clamp);

struct Touched {
  std::uint64_t ticks = 0, touched = 0;  // of joints
  Duration ramp;
  MonoTime tracking_since;

  void tick(const TickRecord& record) {
    const TickRecordHeader& header = record.header;
    if (header.mode != Mode::tracking)
      tracking_since = {};
    else if (!tracking_since.is_set())
      tracking_since = header.now;
    if (!tracking_since.is_set() || header.now - tracking_since <= ramp) return;
    for (std::size_t j = 0; j < header.joint_count; ++j) {
      ++ticks;
      touched += (record.joints[j].interventions & kLimits) != 0 ? 1U : 0U;
    }
  }
};

class NominalLimits : public testing::TestWithParam<const char*> {};

TEST_P(NominalLimits, AreTouchedInOnePercentOfJointTicksAtMost) {
  const auto robot = config::load("config/" + std::string(GetParam()) + ".yaml");
  ASSERT_TRUE(robot.has_value()) << robot.error();
  const auto policy = policy_host::load_onnx_policy(robot->policy->file, robot->policy->input, robot->policy->output);
  ASSERT_TRUE(policy.has_value()) << policy.error();
  Touched touched{.ramp = robot->degraded.resume_over, .tracking_since = {}};
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    evidence::RolloutRow row;
    touched.tracking_since = {};
    const auto done = evidence::run_rollout(
        {.robot = *robot,
         .policy = **policy,
         .policy_hash = *config::policy_hash(robot->policy->file),
         .timing = {},
         .perturbation = {evidence::find_perturbation("none")->as<evidence::Trouble>(), 0, seconds(1), seconds(1)},
         .seed = seed,
         .duration = seconds(8),
         .scored = seconds(3),
         .bound_m = 0.02,
         .on_tick = [&](const TickRecord& record) { touched.tick(record); }},
        row);
    ASSERT_TRUE(done.has_value()) << done.error();
  }
  ASSERT_GT(touched.ticks, 10'000U);
  const double share = static_cast<double>(touched.touched) / static_cast<double>(touched.ticks);
  std::printf("%s: limits touched in %.4f of %llu joint-ticks\n", GetParam(), share,
              static_cast<unsigned long long>(touched.ticks));
  EXPECT_LE(share, kMostTouched);
}

INSTANTIATE_TEST_SUITE_P(Demos, NominalLimits, testing::Values("arm6", "dual_arm12", "arm6_visuomotor", "cart_pole"),
                         [](const auto& one) { return std::string(one.param); });

}  // namespace
}  // namespace takt::lab
