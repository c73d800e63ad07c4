// SPDX-License-Identifier: Apache-2.0
// A robot of three joints with a two-value sensor, small enough to compute its policy's input by hand.
#pragma once

#include "config/robot_config.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/sensor_sample.hpp"

namespace takt::policy_host {

inline config::ObservationTerm term(config::TermKind kind, double scale, std::uint32_t history = 1) {
  config::ObservationTerm result;
  result.kind = kind;
  result.scale = {scale};
  result.history = history;
  if (kind == config::TermKind::sensor) result.sensor = "eye";
  return result;
}

inline config::RobotConfig small_robot() {
  config::RobotConfig robot;
  robot.file = "small.yaml";
  robot.robot = "small";
  const double homes[] = {1.0, 2.0, 3.0};
  for (std::size_t i = 0; i < 3; ++i) {
    config::Joint joint;
    joint.name = std::string(1, static_cast<char>('a' + i));
    joint.home = homes[i];
    robot.joints.push_back(joint);
  }
  robot.sensors.push_back({.name = "eye", .values = 2, .timeout = milliseconds(200)});
  config::Policy policy;
  policy.file = "small.onnx";
  policy.input = "obs";
  policy.output = "actions";
  policy.period = milliseconds(20);
  policy.step_period = milliseconds(10);
  policy.steps = 4;
  policy.history_layout = "by_term";
  policy.history_order = "oldest_first";
  policy.observation = {term(config::TermKind::joint_position_relative, 1), term(config::TermKind::sensor, 1, 2),
                        term(config::TermKind::last_action, 1)};
  policy.action.scale = {1.0};
  robot.policy = policy;
  return robot;
}

inline Observation small_observation(std::uint64_t id) {
  Observation observation;
  observation.id = id;
  observation.published_at = MonoTime{} + milliseconds(20) * static_cast<std::int64_t>(id);
  observation.period = milliseconds(20);
  observation.joint_count = 3;
  for (std::size_t i = 0; i < 3; ++i) {
    observation.q[i] = static_cast<float>(i + 1) + 0.5F;   // home + 0.5
    observation.dq[i] = static_cast<float>(10 * (i + 1));  // 10, 20, 30
  }
  return observation;
}

inline SensorSample small_sample(std::uint64_t sequence, float first, float second) {
  SensorSample sample;
  sample.sequence = sequence;
  sample.sensed_at = MonoTime{} + milliseconds(30) * static_cast<std::int64_t>(sequence);
  sample.value_count = 2;
  sample.values[0] = first;
  sample.values[1] = second;
  return sample;
}

}  // namespace takt::policy_host
