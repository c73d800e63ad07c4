// SPDX-License-Identifier: Apache-2.0
#include "policy_host/chunk_builder.hpp"

#include <algorithm>

#include "config/observation_shape.hpp"
#include "policy_host/flow/flow_policy.hpp"

namespace takt::policy_host {
namespace {

float offset_of(const config::RobotConfig& robot, std::size_t output, std::size_t joint) {
  const config::Action& action = robot.policy->action;
  switch (action.offset) {
    case config::OffsetKind::zero:
    case config::OffsetKind::measured:
      return 0.0F;
    case config::OffsetKind::home:
      return static_cast<float>(robot.joints[joint].home);
    case config::OffsetKind::values:
      return static_cast<float>(action.offset_values[output]);
  }
  return 0.0F;
}

constexpr unsigned bit(CommandField field) {
  return static_cast<unsigned>(field);
}

float& value(CommandChunk& chunk, CommandField field, std::size_t step, std::size_t joint) {
  return chunk.values[value_index(chunk.header, field, step, joint)];
}

}  // namespace

ChunkBuilder::ChunkBuilder(const config::RobotConfig& robot, std::uint64_t policy_hash)
    : kind_(robot.policy->action.kind),
      measured_(robot.policy->action.offset == config::OffsetKind::measured),
      differentiates_(robot.policy->action.interpolation == config::Interpolation::cubic &&
                      robot.policy->action.velocity == "none"),
      agreed_(robot.policy->sampler && robot.policy->sampler->choice == config::SampleChoice::agreed) {
  const config::Policy& policy = *robot.policy;
  for (const config::NamedOutput& output : config::named_outputs(policy)) further_.push_back(output.field);
  further_.erase(further_.begin());
  for (std::size_t i = 0; i < config::outputs_per_step(robot); ++i) {
    const std::size_t joint = policy.action.joint_of_output.empty() ? i : policy.action.joint_of_output[i];
    const double scale = policy.action.scale.size() == 1 ? policy.action.scale.front() : policy.action.scale[i];
    outputs_.push_back({joint, static_cast<float>(scale), offset_of(robot, i, joint)});
  }
  for (const config::Joint& joint : robot.joints)
    idle_.push_back({static_cast<float>(joint.home), static_cast<float>(joint.kp), static_cast<float>(joint.kd)});
  header_.policy_hash = policy_hash;
  header_.step_period = policy.step_period;
  header_.step_count = static_cast<std::uint16_t>(policy.steps);
  header_.joint_count = static_cast<std::uint16_t>(robot.joints.size());
  header_.fields = config::chunk_fields(policy);
}

void ChunkBuilder::fill_step(CommandChunk& chunk, const Observation& answered, std::size_t step,
                             std::span<const float> outputs) const {
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    const auto [joint, scale, offset] = outputs_[i];
    const float target = offset + scale * outputs[i];
    float& q = value(chunk, CommandField::q, step, joint);
    switch (kind_) {
      case config::ActionKind::joint_position:
        q = measured_ ? answered.q[joint] + target : target;
        break;
      case config::ActionKind::joint_velocity:
        q = answered.q[joint];
        value(chunk, CommandField::dq, step, joint) = target;
        value(chunk, CommandField::kp, step, joint) = 0.0F;
        break;
      case config::ActionKind::joint_torque:
        q = answered.q[joint];
        value(chunk, CommandField::tau_ff, step, joint) = target;
        value(chunk, CommandField::kp, step, joint) = 0.0F;
        value(chunk, CommandField::kd, step, joint) = 0.0F;
        break;
    }
  }
}

void ChunkBuilder::fill_further(CommandChunk& chunk, std::size_t step, std::span<const float> outputs) const {
  for (std::size_t k = 0; k < further_.size(); ++k)
    for (std::size_t i = 0; i < outputs_.size(); ++i)
      value(chunk, further_[k], step, outputs_[i].joint) =
          outputs[(k * header_.step_count + step) * outputs_.size() + i];
}

void ChunkBuilder::fill_velocities(CommandChunk& chunk) {
  const CommandHeader& header = chunk.header;
  const float period = static_cast<float>(header.step_period.ns) * 1.0e-9F;
  if (header.step_count < 2) return;  // one step stands
  for (std::size_t step = 0; step < header.step_count; ++step) {
    const std::size_t before = step == 0 ? 0 : step - 1;
    const std::size_t after = std::min<std::size_t>(step + 1, header.step_count - 1U);
    const float span = static_cast<float>(after - before) * period;
    for (std::size_t joint = 0; joint < header.joint_count; ++joint)
      value(chunk, CommandField::dq, step, joint) =
          (value(chunk, CommandField::q, after, joint) - value(chunk, CommandField::q, before, joint)) / span;
  }
}

void ChunkBuilder::fill(CommandChunk& chunk, const Observation& answered, std::span<const float> outputs) const {
  chunk.header = header_;
  chunk.header.observation_id = answered.id;
  if (agreed_) chunk.header.step_count = static_cast<std::uint16_t>(meant_steps(outputs, outputs_.size()));
  std::fill_n(chunk.values, chunk.value_count(), 0.0F);
  const bool with_kp = (header_.fields & bit(CommandField::kp)) != 0;
  const bool with_kd = (header_.fields & bit(CommandField::kd)) != 0;
  const std::size_t action_width = header_.step_count * outputs_.size();
  for (std::size_t step = 0; step < chunk.header.step_count; ++step) {
    for (std::size_t joint = 0; joint < idle_.size(); ++joint) {
      value(chunk, CommandField::q, step, joint) = idle_[joint].home;
      if (with_kp) value(chunk, CommandField::kp, step, joint) = idle_[joint].kp;
      if (with_kd) value(chunk, CommandField::kd, step, joint) = idle_[joint].kd;
    }
    fill_step(chunk, answered, step, outputs.subspan(step * outputs_.size(), outputs_.size()));
    fill_further(chunk, step, outputs.subspan(action_width));
  }
  if (differentiates_) fill_velocities(chunk);
}

LastAction::LastAction(const config::Policy& policy, std::size_t outputs_per_step)
    : step_period_(policy.step_period), width_(outputs_per_step), outputs_(policy.steps * outputs_per_step, 0.0F) {}

void LastAction::remember(const Observation& answered, std::span<const float> outputs) {
  answered_ = answered.published_at;
  const std::span<const float> actions = outputs.first(std::min(outputs.size(), outputs_.size()));
  std::ranges::copy(actions, outputs_.begin());
  for (std::size_t i = actions.size(); i < outputs_.size(); ++i) outputs_[i] = outputs_[i - width_];
}

void LastAction::forget() {
  answered_ = {};
  std::ranges::fill(outputs_, 0.0F);
}

std::span<const float> LastAction::due_at(MonoTime published_at) const {
  const Duration since = answered_.is_set() ? published_at - answered_ : Duration{};
  const std::int64_t nearest = (since.ns + step_period_.ns / 2) / step_period_.ns;
  const auto last_step = static_cast<std::int64_t>(outputs_.size() / width_) - 1;
  const auto step = static_cast<std::size_t>(std::clamp<std::int64_t>(nearest, 0, last_step));
  return std::span(outputs_).subspan(step * width_, width_);
}

}  // namespace takt::policy_host
