// SPDX-License-Identifier: Apache-2.0
// Goal: a walker plays its held actions as softly as the plain PD loop that trained them, and a velocity setpoint that
// no policy meant would not. Method: Unitree's G1 by its published policy, walking in virtual time, where ../shared has
// them: beside what the executive's outputs come to, the torque of kp (action - q) - kd dq from the same actions on the
// same motion; the rms of what changes from tick to tick, all joints. The same robot with its actions taken for a path.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "config/load.hpp"
#include "evidence/rollout/rollout.hpp"
#include "policy_host/onnx_policy.hpp"
#include "tests/evidence/rollout/published_g1.hpp"
#include "tests/support/shared_files.hpp"

namespace takt::lab {
namespace {

// Plays another policy and keeps what it said.
class Listener final : public policy_host::Policy {
 public:
  explicit Listener(policy_host::Policy& policy) : policy_(policy) {}
  [[nodiscard]] std::size_t input_size() const override { return policy_.input_size(); }
  [[nodiscard]] std::size_t output_size() const override { return policy_.output_size(); }
  void infer(std::span<const float> input, std::span<float> output) override {
    policy_.infer(input, output);
    said.emplace_back(output.begin(), output.end());
  }
  void reset() override { policy_.reset(); }
  std::vector<std::vector<float>> said;

 private:
  policy_host::Policy& policy_;
};

// Joint by joint, from tick to tick.
class ChangeOfTorque {
 public:
  void add(std::size_t joint, double torque, bool follows) {
    if (follows) {
      sum_ += (torque - last_[joint]) * (torque - last_[joint]);
      ++count_;
    }
    last_[joint] = torque;
  }
  [[nodiscard]] double rms(Duration period) const {
    return std::sqrt(sum_ / static_cast<double>(count_)) / period.seconds();
  }

 private:
  std::array<double, kMaxJoints> last_{};
  double sum_ = 0;
  std::uint64_t count_ = 0;
};

struct Rates {
  double played = 0, plain = 0;  // Nm/s, rms
};

double target_of(const config::RobotConfig& robot, std::size_t output, double said) {
  const auto& action = robot.policy->action;
  const std::size_t joint = action.joint_of_output.empty() ? output : action.joint_of_output[output];
  const double scale = action.scale.size() == 1 ? action.scale[0] : action.scale[output];
  const double offset = action.offset == config::OffsetKind::values ? action.offset_values[output]
                        : action.offset == config::OffsetKind::home ? robot.joints[joint].home
                                                                    : 0.0;
  return offset + scale * said;
}

Rates walk(const config::RobotConfig& robot) {
  const auto network = policy_host::load_onnx_policy(robot.policy->file, "obs", "actions").value();
  const auto fallback = evidence::load_fallback_host(robot).value();
  Listener policy(*network);
  ChangeOfTorque played, plain;
  bool follows = false;
  const auto look = [&](const TickRecord& record) {
    const TickRecordHeader& header = record.header;
    if (header.mode != Mode::tracking || header.player != Player::policy ||
        header.seats[Seat::policy].command_sequence == 0) {
      follows = false;
      return;
    }
    const std::vector<float>& action = policy.said.at(header.seats[Seat::policy].command_sequence - 1);
    for (std::size_t output = 0; output < action.size(); ++output) {
      const auto& order = robot.policy->action.joint_of_output;
      const std::size_t j = order.empty() ? output : order[output];
      const config::Joint& joint = robot.joints[j];
      const JointRecord& at = record.joints[j];
      const double wanted = target_of(robot, output, static_cast<double>(action[output]));
      const double pd =
          joint.kp * (wanted - static_cast<double>(at.q_estimate)) - joint.kd * static_cast<double>(at.dq_estimate);
      plain.add(j, std::clamp(pd, -joint.limits.torque, joint.limits.torque), follows);
      played.add(j, static_cast<double>(at.tau_total), follows);
    }
    follows = true;
  };
  evidence::RolloutRow row;
  const auto done = evidence::run_rollout({.robot = robot,
                                           .policy = policy,
                                           .policy_hash = 1,
                                           .fallback = fallback.get(),
                                           .task = evidence::Task::base_velocity,
                                           .timing = {},
                                           .perturbation = {},
                                           .seed = 1,
                                           .duration = seconds(8),
                                           .scored = seconds(2),
                                           .bound_m = 0.3,
                                           .on_tick = look},
                                          row);
  EXPECT_TRUE(done) << (done ? "" : done.error());
  EXPECT_TRUE(row.success) << row.failure_label;
  return {played.rms(robot.control.period), plain.rms(robot.control.period)};
}

TEST(TorqueRate, APublishedWalkerIsPlayedAsSoftlyAsItsPlainLoop) {
  TAKT_NEEDS_SHARED(test::kG1Model, test::kG1Policy + "policy.onnx", test::kG1Policy + "deploy.yaml");
  const std::string path = testing::TempDir() + "takt-g1-torque-" + std::to_string(getpid()) + ".yaml";
  test::import_g1(path);
  const config::RobotConfig robot = config::load(path).value();
  std::remove(path.c_str());
  ASSERT_EQ(robot.policy->action.interpolation, config::Interpolation::hold) << "as it was trained";
  config::RobotConfig chased = robot;
  chased.policy->action.interpolation = config::Interpolation::linear;
  const Rates held = walk(robot), as_path = walk(chased);
  std::printf("hold: %.0f Nm/s rms, plain PD loop %.0f: %.2f times; as a path: %.0f against %.0f: %.2f times\n",
              held.played, held.plain, held.played / held.plain, as_path.played, as_path.plain,
              as_path.played / as_path.plain);
  EXPECT_LT(held.played, 1.2 * held.plain);
  EXPECT_GT(as_path.played, 1.5 * as_path.plain) << "what a velocity setpoint costs that nobody meant";
}

}  // namespace
}  // namespace takt::lab
