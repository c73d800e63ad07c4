// SPDX-License-Identifier: Apache-2.0
#include "config/observation_shape.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "executive/contract/policy_input.hpp"

namespace takt::config {
namespace {

// Of what a policy host publishes: images are named, and stand in no input (executive/contract/policy_input.hpp).
std::size_t largest_of_host(const RobotConfig& robot) {
  std::size_t values = robot.joints.size() + observation_width(robot) + flow_context_width(robot) + output_width(robot);
  std::size_t samples = robot.sensors.size();
  for (const ObservationTerm& term : robot.policy->observation) {
    if (image_of(robot, term) == nullptr) continue;
    values -= term_width(robot, term) * term.history;
    samples += term.history;
  }
  for (const Sensor& sensor : robot.sensors) values += sensor.values;
  return policy_input_bytes(samples, values);
}

// Of what libtakt-client publishes: any quantity of the joints, of each sensor the newest sample and a queue.
std::size_t largest_of_client(const RobotConfig& robot) {
  std::size_t values = kShownQuantities * robot.joints.size();
  std::size_t samples = 0;
  for (const Sensor& sensor : robot.sensors) {
    values += sensor.values * (1 + std::size_t{sensor.queue});
    samples += 1 + std::size_t{sensor.queue};
  }
  return policy_input_bytes(samples, values);
}

}  // namespace

bool is_of_joints(TermKind kind) {
  switch (kind) {
    case TermKind::joint_position_relative:
    case TermKind::joint_position:
    case TermKind::joint_velocity:
    case TermKind::joint_torque:
    case TermKind::drive_velocity:
      return true;
    case TermKind::sensor:
    case TermKind::last_action:
    case TermKind::constant:
    case TermKind::base_angular_velocity:
    case TermKind::projected_gravity:
    case TermKind::command:
    case TermKind::gait_phase:
    case TermKind::base_orientation:
    case TermKind::motion_reference:
      return false;
  }
  return false;
}

std::size_t observed_joints(const RobotConfig& robot) {
  return robot.policy->joint_order.empty() ? robot.joints.size() : robot.policy->joint_order.size();
}

std::size_t outputs_per_step(const RobotConfig& robot) {
  const auto& driven = robot.policy->action.joint_of_output;
  return driven.empty() ? robot.joints.size() : driven.size();
}

std::size_t term_width(const RobotConfig& robot, const ObservationTerm& term) {
  switch (term.kind) {
    case TermKind::joint_position_relative:
    case TermKind::joint_position:
    case TermKind::joint_velocity:
    case TermKind::joint_torque:
    case TermKind::drive_velocity:
      return term.joints.empty() ? observed_joints(robot) : term.joints.size();
    case TermKind::last_action:
      return outputs_per_step(robot);
    case TermKind::sensor:
    case TermKind::command: {
      const auto sensor = std::ranges::find(robot.sensors, term.sensor, &Sensor::name);
      if (sensor == robot.sensors.end()) return 0;
      return sensor->image ? sensor->image->bytes() : sensor->values;
    }
    case TermKind::constant:
      return term.constant.size();
    case TermKind::base_angular_velocity:
    case TermKind::projected_gravity:
      return 3;
    case TermKind::gait_phase:
      return 2;
    case TermKind::base_orientation:
      return 4;
    case TermKind::motion_reference:
      return term.values;
  }
  return 0;
}

const ImageShape* image_of(const RobotConfig& robot, const ObservationTerm& term) {
  const auto sensor = std::ranges::find(robot.sensors, term.sensor, &Sensor::name);
  return sensor != robot.sensors.end() && sensor->image ? &*sensor->image : nullptr;
}

bool sees_images(const RobotConfig& robot) {
  return std::ranges::any_of(robot.policy->observation,
                             [&](const ObservationTerm& term) { return image_of(robot, term) != nullptr; });
}

std::size_t scales_of(const RobotConfig& robot, const ObservationTerm& term) {
  const ImageShape* const image = image_of(robot, term);
  return image != nullptr ? image->channels : term_width(robot, term);
}

std::size_t observation_width(const RobotConfig& robot) {
  std::size_t width = 0;
  for (const ObservationTerm& term : robot.policy->observation) width += term_width(robot, term) * term.history;
  return width;
}

std::size_t flow_context_width(const RobotConfig& robot) {
  constexpr std::size_t kIdAndCounts = 5;
  return robot.policy->sampler ? kIdAndCounts + robot.policy->steps * outputs_per_step(robot) : 0;
}

std::size_t largest_policy_input(const RobotConfig& robot) {
  if (!robot.policy || !robot.record.policy_inputs) return 0;
  const std::size_t bytes = std::max(largest_of_host(robot), largest_of_client(robot));
  return bytes <= kMaxPolicyInputBytes ? bytes : 0;
}

RobotConfig seen_by_fallback(const RobotConfig& robot, const Fallback& fallback) {
  RobotConfig seen = robot;
  seen.policy->requests_in_flight = 1;
  // No observation tells it what of its own path is being played.
  if (seen.policy->sampler) seen.policy->sampler->prefix = PrefixUse::none;
  if (fallback.has_own_file()) seen.policy->file = fallback.file;
  for (ObservationTerm& term : seen.policy->observation) {
    if (term.kind != TermKind::command) continue;
    term.kind = TermKind::constant;
    term.constant = fallback.command;
    term.sensor.clear();
  }
  return seen;
}

bool reads_sensors(const Policy& policy) {
  return std::ranges::any_of(policy.observation, [](const ObservationTerm& term) { return !term.sensor.empty(); });
}

std::vector<NamedOutput> named_outputs(const Policy& policy) {
  const Action& action = policy.action;
  const CommandField first = action.kind == ActionKind::joint_position   ? CommandField::q
                             : action.kind == ActionKind::joint_velocity ? CommandField::dq
                                                                         : CommandField::tau_ff;
  std::vector<NamedOutput> outputs{{first, policy.output}};
  for (const auto& [field, name] :
       {std::pair{CommandField::dq, &action.velocity}, std::pair{CommandField::kp, &action.kp},
        std::pair{CommandField::kd, &action.kd}, std::pair{CommandField::tau_ff, &action.torque}})
    if (*name != "none") outputs.push_back({field, *name});
  return outputs;
}

std::uint8_t chunk_fields(const Policy& policy) {
  const auto bit = [](CommandField field) { return static_cast<unsigned>(field); };
  unsigned fields = bit(CommandField::q);
  switch (policy.action.kind) {
    case ActionKind::joint_position:
      if (policy.action.interpolation == Interpolation::cubic) fields |= bit(CommandField::dq);
      break;
    case ActionKind::joint_velocity:
      fields |= bit(CommandField::kp) | bit(CommandField::kd) | bit(CommandField::dq);
      break;
    case ActionKind::joint_torque:
      fields |= bit(CommandField::kp) | bit(CommandField::kd) | bit(CommandField::tau_ff);
      break;
  }
  const std::vector<NamedOutput> outputs = named_outputs(policy);
  for (const NamedOutput& further : std::span(outputs).subspan(1)) fields |= bit(further.field);
  return static_cast<std::uint8_t>(fields);
}

std::size_t output_width(const RobotConfig& robot) {
  return named_outputs(*robot.policy).size() * robot.policy->steps * outputs_per_step(robot);
}

}  // namespace takt::config
