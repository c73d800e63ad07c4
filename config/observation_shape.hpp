// SPDX-License-Identifier: Apache-2.0
// How many numbers the policy is shown and how many it gives. Precondition everywhere: robot.policy.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"

namespace takt::config {

std::size_t observed_joints(const RobotConfig& robot);  // length of every joint term
bool is_of_joints(TermKind kind);                       // one value per joint
// As a robot file spells them.
inline constexpr std::array<std::string_view, 14> kTermNames{
    "joint_position_relative", "joint_position",    "joint_velocity", "sensor",     "last_action",  "constant",
    "base_angular_velocity",   "projected_gravity", "command",        "gait_phase", "joint_torque", "drive_velocity",
    "base_orientation",        "motion_reference"};
constexpr std::string_view name(TermKind kind) {
  return kTermNames[static_cast<std::size_t>(kind)];
}
std::size_t outputs_per_step(const RobotConfig& robot);  // joints the policy drives
// Numbers of one instant of a term, bytes of an image; 0 for a sensor that is not declared.
std::size_t term_width(const RobotConfig& robot, const ObservationTerm& term);
// Of a term that shows images, their shape; null: it shows none.
const ImageShape* image_of(const RobotConfig& robot, const ObservationTerm& term);
bool sees_images(const RobotConfig& robot);
// How many scales, means and deviations a term may have, where it has not one for all: one per value, of images one per
// channel.
std::size_t scales_of(const RobotConfig& robot, const ObservationTerm& term);
// Width of the model's input: every term times its history.
std::size_t observation_width(const RobotConfig& robot);
// What a sampler is shown besides (policy_host/flow/flow_context.hpp); 0: the policy has none.
std::size_t flow_context_width(const RobotConfig& robot);

// Bytes of the largest policy_input.hpp that a policy's process publishes; 0: this robot's are not recorded, because
// `record` says so, or because they would be larger than kMaxPolicyInputBytes, images aside. The same for the fallback
// policy. Here alone the robot may be without a policy.
std::size_t largest_policy_input(const RobotConfig& robot);

// The robot as its fallback policy's host sees it: `policy` is the fallback, which reads its own constant command.
RobotConfig seen_by_fallback(const RobotConfig& robot, const Fallback& fallback);
// The policy reads sensors outside the executive, so that its commands must say when those sensed.
bool reads_sensors(const Policy& policy);

// What a step's numbers mean, in the order in which a policy gives them: all steps of the first, then of the next.
struct NamedOutput {
  CommandField field;
  std::string name;
};
// The action itself, and action.outputs as far as they are named. The first one's field is that of the action's kind.
std::vector<NamedOutput> named_outputs(const Policy& policy);
// Fields of a chunk of such a policy, a mask of CommandField: the action's, what its kind needs with it, and what
// further outputs say.
std::uint8_t chunk_fields(const Policy& policy);
// Numbers of one answer: steps * outputs_per_step of each.
std::size_t output_width(const RobotConfig& robot);

}  // namespace takt::config
