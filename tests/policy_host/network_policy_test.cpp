// SPDX-License-Identifier: Apache-2.0
// Goal: what a network says of its motion is what it is shown next, beginning after a reset with an inference of zeros
// at time step 0. Method: a network that shows its inputs in its outputs.
#include "policy_host/network_policy.hpp"

#include <gtest/gtest.h>

#include <array>

namespace takt::policy_host {
namespace {

using onnx_engine::TensorInfo;

// action = obs (3 values); joint_pos = 10 * time_step + obs[0] (1 value)
class Tracker final : public Network {
 public:
  [[nodiscard]] std::span<const TensorInfo> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const TensorInfo> outputs() const override { return outputs_; }
  std::span<float> input(std::size_t i) override {
    return i == 0 ? std::span<float>(obs_) : std::span<float>(time_step_);
  }
  [[nodiscard]] std::span<const float> output(std::size_t i) const override {
    return i == 0 ? std::span<const float>(action_) : std::span<const float>(joint_pos_);
  }
  void run() override {
    action_ = obs_;
    joint_pos_[0] = 10 * time_step_[0] + obs_[0];
  }

 private:
  std::array<TensorInfo, 2> inputs_{TensorInfo{"obs", {1, 3}}, {"time_step", {1, 1}}};
  std::array<TensorInfo, 2> outputs_{TensorInfo{"action", {1, 3}}, {"joint_pos", {1, 1}}};
  std::array<float, 3> obs_{}, action_{};
  std::array<float, 1> time_step_{}, joint_pos_{};
};

TEST(NetworkPolicy, AMotionReferenceIsTheNetworksOwnOfTheInferenceBefore) {
  std::vector<std::unique_ptr<Network>> networks;
  networks.push_back(std::make_unique<Tracker>());
  Wiring wiring;
  wiring.observation = {{0, 0}};
  wiring.time_steps = {{0, 1}};
  wiring.outputs = {{0, 0}, {0, 1}};
  wiring.references = {{.from = {0, 1}, .at = 1}};
  const auto policy = make_network_policy(std::move(networks), std::move(wiring));
  EXPECT_EQ(policy->input_size(), 3U);
  EXPECT_EQ(policy->output_size(), 4U);
  EXPECT_TRUE(policy->is_recurrent());
  using Values = std::vector<float>;
  Values said(4);
  for (int round = 0; round < 2; ++round) {
    policy->infer(Values{2, 0, 4}, said);
    EXPECT_EQ(said, (Values{2, 0, 4, 12})) << "shown: of zeros at time step 0; now it is 1";
    policy->infer(Values{3, 0, 5}, said);
    EXPECT_EQ(said, (Values{3, 12, 5, 23}));
    policy->reset();
  }
}

// action = the rest of the step count by three
class Thirds final : public Network {
 public:
  [[nodiscard]] std::span<const TensorInfo> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const TensorInfo> outputs() const override { return outputs_; }
  std::span<float> input(std::size_t i) override { return i == 0 ? std::span(obs_) : std::span(count_); }
  [[nodiscard]] std::span<const float> output(std::size_t) const override { return action_; }
  void run() override { action_[0] = static_cast<float>(static_cast<std::uint32_t>(count_[0]) % 3); }

 private:
  std::array<TensorInfo, 2> inputs_{TensorInfo{"obs", {1, 1}}, {"ctx.step_count", {}}};
  std::array<TensorInfo, 1> outputs_{TensorInfo{"action", {1, 1}}};
  std::array<float, 1> obs_{}, count_{}, action_{};
};

// A day at 200 Hz is more steps than a float32 tells apart.
TEST(NetworkPolicy, AStepCountsRemainderGoesOnForEver) {
  std::vector<std::unique_ptr<Network>> networks;
  networks.push_back(std::make_unique<Thirds>());
  Wiring wiring;
  wiring.observation = {{0, 0}};
  wiring.step_counts = {{0, 1}};
  wiring.outputs = {{0, 0}};
  const auto policy = make_network_policy(std::move(networks), std::move(wiring));
  EXPECT_TRUE(policy->is_recurrent());
  const std::array<float, 1> observation{};
  std::array<float, 1> action{};
  for (std::uint32_t step = 0; step < (1U << 24U) + 30; ++step) {
    policy->infer(observation, action);
    ASSERT_EQ(action[0], static_cast<float>(step % 3)) << step;
  }
}

}  // namespace
}  // namespace takt::policy_host
