// SPDX-License-Identifier: Apache-2.0
// A flow's velocity network behind the Policy port, as a policy that says whole chunks: draws noise, denoises it in
// equal steps x += v(observation, x, t) / n from t = 0 (noise) to t = 1 (action), and chooses among samples.
//
// input:  the observation terms, then config::flow_context_width(robot) values (flow_context.hpp)
// output: steps * outputs values. With choice `agreed` steps beyond those that are meant are NaN (meant_steps())
//
//   prefix none     every sample for itself
//   prefix guided   drawn towards the path (prefix_guidance.hpp), the promised steps wholly, those that the path does
//   not
//                   have at all: v' = v + scale * weight * (path - (x + (1 - t) v))
//   prefix trained  the promised steps and one more (FlowContext::kept) stand in x as they are, at time 1, in every
//   step
//                   of denoising: for a network with one time per step, trained so (arXiv 2512.05964)
//   coherent        of several samples the nearest to the path: sum over its steps of exp(-decay i) |a - path|, as the
//                   backward coherence of bidirectional decoding; its forward contrast needs a weaker policy and is
//                   left out
//   agreed          the first sample, up to the first step where any differs from it by more than the tolerance in any
//                   output: a horizon that is short where the policy does not know what to do
//
// A function of its input and the seed: noise comes from the seed, the observation's id and the sample's number. No
// hidden state. Sources of the rules: the docs page docs/flow-policies.md. Thread rule: as the network's.
#pragma once

#include <cstddef>
#include <expected>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "policy_host/flow/flow_context.hpp"
#include "policy_host/policy.hpp"

namespace takt::policy_host {

struct FlowShape {
  std::size_t observation = 0, steps = 0, outputs = 0;  // outputs: of one step
};

class FlowPolicy final : public Policy {
 public:
  // Precondition: check_flow(). `velocity`: input the observation, x, and one time or one per step; output the
  // velocity.
  FlowPolicy(std::unique_ptr<Policy> velocity, const FlowShape& shape, const config::Sampler& sampler);

  [[nodiscard]] std::size_t input_size() const override;
  [[nodiscard]] std::size_t output_size() const override { return shape_.steps * shape_.outputs; }
  void infer(std::span<const float> input, std::span<float> output) override;
  void reset() override {}
  [[nodiscard]] bool is_recurrent() const override { return false; }
  [[nodiscard]] std::string description() const override { return velocity_->description(); }
  [[nodiscard]] bool is_built_in() const override { return velocity_->is_built_in(); }

 private:
  void sample(std::span<const float> input, std::size_t number, std::span<float> x);
  void denoise(std::span<const float> observation, const FlowContext& context, std::span<float> x);
  [[nodiscard]] double distance(std::span<const float> path, std::size_t known, std::span<const float> x) const;

  std::unique_ptr<Policy> velocity_;
  FlowShape shape_;
  config::Sampler sampler_;
  std::size_t times_;  // 1, or one per step
  std::vector<float> shown_, v_;
  std::vector<std::vector<float>> samples_;
};

// The robot's policy from the network in its file: the network itself, or a sampler around it. The error is one line.
std::expected<std::unique_ptr<Policy>, std::string> with_sampler(const config::RobotConfig& robot,
                                                                 std::unique_ptr<Policy> network);
// Names of the network's input tensors, in their order, as assign_tensors() takes them.
std::string network_input(const config::Policy& section);

// How many steps of an output are meant: up to the first that is NaN throughout. Precondition: robot.policy->sampler
// with choice agreed, the only one that says less than all.
std::size_t meant_steps(std::span<const float> output, std::size_t outputs);

}  // namespace takt::policy_host
