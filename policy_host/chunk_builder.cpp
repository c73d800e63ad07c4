#include "policy_host/chunk_builder.hpp"

#include <algorithm>

#include "config/observation_shape.hpp"

namespace takt::policy_host {
namespace {

float offset_of(const config::RobotConfig& robot, std::size_t output, std::size_t joint) {
  const config::Action& action = robot.policy->action;
  switch (action.offset) {
    case config::OffsetKind::zero:
      return 0.0F;
    case config::OffsetKind::home:
      return static_cast<float>(robot.joints[joint].home);
    case config::OffsetKind::values:
      return static_cast<float>(action.offset_values[output]);
  }
  return 0.0F;
}

}  // namespace

ChunkBuilder::ChunkBuilder(const config::RobotConfig& robot, std::uint64_t policy_hash) {
  const config::Policy& policy = *robot.policy;
  for (std::size_t i = 0; i < config::outputs_per_step(robot); ++i) {
    const std::size_t joint = policy.action.joint_of_output.empty() ? i : policy.action.joint_of_output[i];
    const double scale = policy.action.scale.size() == 1 ? policy.action.scale.front() : policy.action.scale[i];
    outputs_.push_back({joint, static_cast<float>(scale), offset_of(robot, i, joint)});
  }
  for (const config::Joint& joint : robot.joints) home_.push_back(static_cast<float>(joint.home));
  header_.policy_hash = policy_hash;
  header_.step_period = policy.step_period;
  header_.step_count = static_cast<std::uint16_t>(policy.steps);
  header_.joint_count = static_cast<std::uint16_t>(robot.joints.size());
  header_.fields = static_cast<std::uint8_t>(CommandField::q);
}

void ChunkBuilder::fill(CommandChunk& chunk, const Observation& answered, std::span<const float> outputs) const {
  chunk.header = header_;
  chunk.header.observation_id = answered.id;
  for (std::size_t step = 0; step < header_.step_count; ++step) {
    std::ranges::copy(home_, &chunk.values[value_index(chunk.header, CommandField::q, step, 0)]);
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      const Output& output = outputs_[i];
      chunk.values[value_index(chunk.header, CommandField::q, step, output.joint)] =
          output.offset + output.scale * outputs[step * outputs_.size() + i];
    }
  }
}

LastAction::LastAction(const config::Policy& policy, std::size_t outputs_per_step)
    : step_period_(policy.step_period), width_(outputs_per_step), outputs_(policy.steps * outputs_per_step, 0.0F) {}

void LastAction::remember(const Observation& answered, std::span<const float> outputs) {
  answered_ = answered.published_at;
  std::ranges::copy(outputs, outputs_.begin());
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
