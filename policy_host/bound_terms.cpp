// SPDX-License-Identifier: Apache-2.0
#include "policy_host/bound_terms.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "config/joint_units.hpp"
#include "config/observation_shape.hpp"
#include "config/units.hpp"

namespace takt::policy_host {
namespace {

using config::ObservationTerm;
using config::RobotConfig;
using config::TermKind;

std::string unit_and_frame(const RobotConfig& robot, const std::string& name) {
  const auto sensor = std::ranges::find(robot.sensors, name, &config::Sensor::name);
  if (sensor == robot.sensors.end()) return "";
  const std::string unit = sensor->unit == "unstated" ? "unit unstated" : sensor->unit;
  return sensor->frame == "unstated" ? unit : fmt::format("{}, frame {}", unit, sensor->frame);
}

std::string sensor_text(const RobotConfig& robot, const ObservationTerm& term) {
  if (const config::ImageShape* const image = config::image_of(robot, term))
    return fmt::format("images of sensor {}, {} x {} x {}, 0 to 1, {}", term.sensor, image->height, image->width,
                       image->channels, term.layout == config::ImageLayout::chw ? "chw" : "hwc");
  return fmt::format("sensor {}, {} values, {}", term.sensor, config::term_width(robot, term),
                     unit_and_frame(robot, term.sensor));
}

std::string command_text(const RobotConfig& robot, const ObservationTerm& term) {
  const std::string unit = unit_and_frame(robot, term.sensor);
  return fmt::format("command {}, {} values{}", term.sensor, config::term_width(robot, term),
                     unit == "unit unstated" ? "" : ", " + unit);
}

std::string source_text(const RobotConfig& robot, const ObservationTerm& term) {
  const std::string imu = robot.imu ? robot.imu->sensor : "none";
  const auto of_joints = [&](const config::JointQuantity& quantity) {
    return fmt::format(
        "{} of {} joints, {}", config::name(term.kind), config::term_width(robot, term),
        config::unit_of_joints(robot, term.joints.empty() ? robot.policy->joint_order : term.joints, quantity));
  };
  switch (term.kind) {
    case TermKind::joint_position:
      return of_joints(config::kJointPosition);
    case TermKind::joint_position_relative:
      return of_joints(config::kJointPosition) + " from home";
    case TermKind::joint_velocity:
    case TermKind::drive_velocity:
      return of_joints(config::kJointVelocity);
    case TermKind::joint_torque:
      return of_joints(config::kJointTorque);
    case TermKind::base_orientation:
      return fmt::format("base_orientation by sensor {}, base in world, {}", imu,
                         term.order == config::QuaternionOrder::wxyz ? "w x y z" : "x y z w");
    case TermKind::base_angular_velocity:
      return fmt::format("base_angular_velocity by sensor {}, rad/s, base frame", imu);
    case TermKind::projected_gravity:
      return fmt::format("projected_gravity by sensor {}, a direction, base frame", imu);
    case TermKind::sensor:
      return sensor_text(robot, term);
    case TermKind::command:
      return command_text(robot, term);
    case TermKind::last_action:
      return fmt::format("last_action of {} joints, as the network gave it", config::term_width(robot, term));
    case TermKind::constant:
      return fmt::format("constant [{}]", fmt::join(term.constant, ", "));
    case TermKind::gait_phase:
      return fmt::format("gait_phase of {}, sine and cosine", config::format_duration(term.gait_period));
    case TermKind::motion_reference:
      return fmt::format("motion_reference, {} values of the network's output {}", term.values, term.output);
  }
  return {};
}

// One number for all, or all of them.
std::string numbers_text(const std::vector<double>& values) {
  const bool equal = std::ranges::all_of(values, [&](double value) { return value == values.front(); });
  return equal ? fmt::format("{}", values.front()) : fmt::format("[{}]", fmt::join(values, ", "));
}

// What becomes of the value on its way: (scale * clipped - mean) / std.
std::string shown_text(const ObservationTerm& term) {
  std::string text;
  const auto add = [&](const char* what, const std::vector<double>& values, double none) {
    if (std::ranges::all_of(values, [&](double value) { return value == none; })) return;
    text += fmt::format(", {} {}", what, numbers_text(values));
  };
  if (!term.clip.empty()) text += fmt::format(", clipped to [{}]", fmt::join(term.clip, ", "));
  add("times", term.scale, 1);
  add("less", term.mean, 0);
  add("divided by", term.standard_deviation, 1);
  return text;
}

std::string places_text(const FilledTensor& input, std::size_t first, std::size_t count) {
  if (first == 0 && count == input.size) return input.name;
  if (count == 1) return fmt::format("{} {}", input.name, first);
  return fmt::format("{} {}..{}", input.name, first, first + count - 1);
}

}  // namespace

std::vector<std::string> bound_lines(std::span<const FilledTensor> inputs, const RobotConfig& robot) {
  const config::Policy& section = *robot.policy;
  const bool by_time = section.history_layout == "by_time";
  std::vector<std::string> lines;
  std::size_t at = 0;
  auto input = inputs.begin();
  for (const ObservationTerm& term : section.observation) {
    if (input == inputs.end()) break;
    const std::size_t width = config::term_width(robot, term);
    // By time, an instant of all terms comes after the other: the places are those of the first.
    const std::size_t count = by_time ? width : width * term.history;
    std::string line =
        fmt::format("{}: {}{}", places_text(*input, at, count), source_text(robot, term), shown_text(term));
    if (term.history > 1)
      line += fmt::format(", {} instants, {}{}", term.history,
                          section.history_order == "newest_first" ? "newest first" : "oldest first",
                          by_time ? fmt::format(", one every {} values", input->size / term.history) : "");
    lines.push_back(std::move(line));
    at += count;
    if (!by_time && at >= input->size) {
      at = 0;
      ++input;
    }
  }
  return lines;
}

std::string action_line(const RobotConfig& robot) {
  const config::Action& action = robot.policy->action;
  const std::size_t joints = action.joint_of_output.empty() ? robot.joints.size() : action.joint_of_output.size();
  const auto kind = [&](const char* name, const config::JointQuantity& quantity) {
    return fmt::format("{}: {} of {} joints, {}, times {}", robot.policy->output, name, joints,
                       config::unit_of_joints(robot, action.joint_of_output, quantity),
                       action.scale.empty() ? "1" : numbers_text(action.scale));
  };
  std::string text;
  switch (action.kind) {
    case config::ActionKind::joint_position:
      text = kind("joint_position", config::kJointPosition);
      break;
    case config::ActionKind::joint_velocity:
      text = kind("joint_velocity", config::kJointVelocity);
      break;
    case config::ActionKind::joint_torque:
      text = kind("joint_torque", config::kJointTorque);
      break;
  }
  switch (action.offset) {
    case config::OffsetKind::home:
      return text + ", from home";
    case config::OffsetKind::zero:
      return text + ", from zero";
    case config::OffsetKind::measured:
      return text + ", from the measured position";
    case config::OffsetKind::values:
      return text + ", from " + numbers_text(action.offset_values);
  }
  return text;
}

}  // namespace takt::policy_host
