// SPDX-License-Identifier: Apache-2.0
// Relations inside the policy: timing, shapes, the order of joints.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "config/checks.hpp"
#include "config/drive_loop.hpp"
#include "config/joint_units.hpp"
#include "config/observation_shape.hpp"
#include "config/units.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/imu.hpp"

namespace takt::config {
namespace {

void check_periods(const RobotConfig& robot, const Policy& policy, Checker& checker) {
  const Duration period = robot.control.period;
  checker.require(policy.period.ns % period.ns == 0, "policy.period",
                  fmt::format("{} is no whole number of control periods of {}; choose a multiple",
                              format_duration(policy.period), format_duration(period)));
  checker.require(robot.freshness.max_age > policy.period, "freshness.max_age",
                  fmt::format("{} must exceed policy.period {}: commands age that much before the next; raise it",
                              format_duration(robot.freshness.max_age), format_duration(policy.period)));
  const Duration horizon = policy.step_period * policy.steps;
  checker.require(horizon > policy.period, "policy.step_period",
                  fmt::format("steps * step_period = {} must exceed policy.period {}: chunks would end before the next "
                              "arrives; raise one: step_period {} lets two answers fail",
                              format_duration(horizon), format_duration(policy.period),
                              format_duration(Duration{3 * policy.period.ns / policy.steps})));
}

void check_source(const RobotConfig& robot, const ObservationTerm& term, const std::string& path, Checker& checker) {
  const bool from_imu = term.kind == TermKind::base_angular_velocity || term.kind == TermKind::projected_gravity ||
                        term.kind == TermKind::base_orientation;
  checker.require(robot.imu || !from_imu, path, "the robot has no IMU that says it; add `imu`");
}

// What a person may ask for.
void check_command(const Sensor& sensor, const std::string& path, Checker& checker) {
  const CommandLimits& limits = *sensor.command;
  const std::size_t count = sensor.values;
  for (const auto& [key, values] : {std::pair{"minimum", &limits.minimum}, std::pair{"maximum", &limits.maximum},
                                    std::pair{"when_absent", &limits.when_absent}}) {
    checker.require(values->size() == count, fmt::format("{}.{}", path, key),
                    fmt::format("has {} values for a sensor of {}; write one each", values->size(), count));
    if (values->size() != count) return;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_range = limits.minimum[i] <= limits.maximum[i];
    checker.require(
        is_range, path + ".minimum",
        fmt::format("value {} is {}, above the maximum {}; swap them", i + 1, limits.minimum[i], limits.maximum[i]));
    if (!is_range) continue;
    checker.require(limits.minimum[i] <= limits.when_absent[i] && limits.when_absent[i] <= limits.maximum[i],
                    path + ".when_absent",
                    fmt::format("value {} is {}, outside [{}, {}]; write one inside", i + 1, limits.when_absent[i],
                                limits.minimum[i], limits.maximum[i]));
  }
}

// The network fills it with values of its own, as they are.
void check_reference(const ObservationTerm& term, const std::string& path, Checker& checker) {
  const bool as_it_is = term.scale == std::vector<double>{1} && term.mean == std::vector<double>{0} &&
                        term.standard_deviation == std::vector<double>{1} && term.clip.empty() && term.history == 1;
  checker.require(as_it_is, path,
                  "motion_reference is shown as the network gives it; drop scale, clip, mean, std and "
                  "history");
}

void check_terms(const RobotConfig& robot, const Policy& policy, Checker& checker) {
  for (std::size_t i = 0; i < policy.observation.size(); ++i) {
    const ObservationTerm& term = policy.observation[i];
    const std::size_t width = scales_of(robot, term);
    check_source(robot, term, fmt::format("policy.observation[{}].term", i), checker);
    for (const auto& [key, values] :
         {std::pair{"scale", &term.scale}, std::pair{"mean", &term.mean}, std::pair{"std", &term.standard_deviation}})
      checker.require(
          values->size() == 1 || values->size() == width, fmt::format("policy.observation[{}].{}", i, key),
          fmt::format("has {} values for a term of {}; write one, or {}", values->size(),
                      image_of(robot, term) != nullptr ? fmt::format("{} channels", width) : fmt::format("{}", width),
                      width));
    checker.require(term.clip.empty() || (term.clip.size() == 2 && term.clip[0] < term.clip[1]),
                    fmt::format("policy.observation[{}].clip", i), "is no range; write [lowest, highest]");
    if (term.kind == TermKind::motion_reference)
      check_reference(term, fmt::format("policy.observation[{}]", i), checker);
    if (policy.history_layout == "by_time")
      checker.require(term.history == policy.observation[0].history, fmt::format("policy.observation[{}].history", i),
                      fmt::format("{} differs from the first term's {}; by_time needs equal histories", term.history,
                                  policy.observation[0].history));
  }
}

// Velocities and torques go into the drive's own impedance law, or into the one on this computer.
bool takes_gains(const Drive& drive) {
  return drive.protocol != DriveProtocol::cia402 || loop_closed_by(drive) == LoopClosedBy::host_torque;
}

void check_meaning(const RobotConfig& robot, const Policy& policy, Checker& checker) {
  const Action& action = policy.action;
  checker.require(action.interpolation != Interpolation::cubic || policy.steps > 1, "policy.action.interpolation",
                  "cubic needs a path of two steps or more; write hold, or raise policy.steps");
  if (action.kind == ActionKind::joint_position) return;
  checker.require(action.interpolation == Interpolation::hold, "policy.action.interpolation",
                  "velocities and torques are held for their step; write hold");
  checker.require(action.offset == OffsetKind::zero, "policy.action.offset",
                  "velocities and torques start from zero; write zero");
  for (const Joint& joint : robot.joints)
    checker.require(joint.passive || takes_gains(joint.drive), "policy.action.kind",
                    fmt::format("joint {}'s drive takes neither gains nor torque in its mode; write joint_position, or "
                                "run the drive in cst",
                                joint.name));
}

// A sampler that does takes up no observation before its answer is being played (policy_host/responder.hpp).
bool draws_on_path(const Sampler& sampler) {
  return sampler.prefix != PrefixUse::none || sampler.choice == SampleChoice::coherent;
}

// d <= s <= H - d. Of most policies s, the steps played of a chunk, is the policy's period: what is promised is played
// before the next observation, and the rest of the chunk reaches past the answer to that one. Where a sampler waits for
// its answer, s is up to d and a period.
void check_prefix(const RobotConfig& robot, const Policy& policy, Checker& checker) {
  const Duration horizon = policy.step_period * policy.steps, longest = policy.action.join.longest;
  const bool waits = policy.sampler && draws_on_path(*policy.sampler);
  checker.require(waits || longest <= policy.period - robot.control.period, "policy.action.join.longest",
                  fmt::format("{} must end a control period before the next observation is published, {} after this "
                              "one; lower it, or raise policy.period",
                              format_duration(longest), format_duration(policy.period)));
  const Duration played = waits ? policy.period + longest : policy.period;
  checker.require(played + longest <= horizon, "policy.action.join.longest",
                  fmt::format("{} and {} exceed the chunk's {}: it would end before the answer to the "
                              "next observation is played; lower it, or raise policy.steps",
                              format_duration(longest),
                              waits ? fmt::format("{} between two answers", format_duration(played))
                                    : fmt::format("policy.period {}", format_duration(policy.period)),
                              format_duration(horizon)));
}

void check_join(const RobotConfig& robot, const Policy& policy, Checker& checker) {
  const Action& action = policy.action;
  const Join& join = action.join;
  const Duration horizon = policy.step_period * policy.steps;
  switch (join.kind) {
    case JoinKind::replace:
    case JoinKind::blend:
      return;
    case JoinKind::ensemble:
      checker.require(
          join.taper <= horizon, "policy.action.join.taper",
          fmt::format("{} exceeds the chunk's {}; lower it", format_duration(join.taper), format_duration(horizon)));
      return;
    case JoinKind::quintic:
      checker.require(action.interpolation != Interpolation::hold, "policy.action.join.kind",
                      "quintic smooths a path, and held steps are none; write align, or interpolate");
      [[fallthrough]];
    case JoinKind::align:
      checker.require(action.kind == ActionKind::joint_position, "policy.action.join.kind",
                      fmt::format("aligns positions, and policy.action.kind is another; write replace, cross_fade, "
                                  "blend or ensemble"));
      [[fallthrough]];
    case JoinKind::cross_fade:
      checker.require(join.over <= horizon, "policy.action.join.over",
                      fmt::format("{} exceeds the chunk's {}; lower it, or write join: {{ kind: replace }}",
                                  format_duration(join.over), format_duration(horizon)));
      return;
    case JoinKind::prefix:
      check_prefix(robot, policy, checker);
      return;
  }
}

// Further outputs say what the action does not.
void check_further_outputs(const RobotConfig& robot, const Action& action, Checker& checker) {
  if (action.velocity != "none") {
    checker.require(action.kind == ActionKind::joint_position, "policy.action.outputs.velocity",
                    "belongs to joint_position; the action says the velocity itself, or there is none");
    checker.require(action.interpolation != Interpolation::linear, "policy.action.interpolation",
                    "linear draws its own velocities; write hold or cubic, or drop policy.action.outputs.velocity");
  }
  checker.require(action.torque == "none" || action.kind != ActionKind::joint_torque, "policy.action.outputs.torque",
                  "the action says the torque itself; drop it");
  if (action.kp == "none" && action.kd == "none" && action.torque == "none") return;
  for (const Joint& joint : robot.joints)
    checker.require(joint.passive || takes_gains(joint.drive), "policy.action.outputs",
                    fmt::format("joint {}'s drive takes neither gains nor torque in its mode; drop kp, kd and torque, "
                                "or run the drive in cst",
                                joint.name));
}

void check_action(const RobotConfig& robot, const Action& action, Checker& checker) {
  check_further_outputs(robot, action, checker);
  const std::size_t outputs = outputs_per_step(robot);
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    const auto& driven = action.joint_of_output;
    const bool asked = driven.empty() || std::ranges::find(driven, joint) != driven.end();
    checker.require(
        !asked || !robot.joints[joint].passive, "policy.action.joints",
        fmt::format("give passive joint {} an output; list the driven joints only", robot.joints[joint].name));
  }
  checker.require(action.scale.size() == 1 || action.scale.size() == outputs, "policy.action.scale",
                  fmt::format("has {} values for {} outputs; write one, or {}", action.scale.size(), outputs, outputs));
  if (action.offset == OffsetKind::values)
    checker.require(action.offset_values.size() == outputs, "policy.action.offset",
                    fmt::format("has {} values for {} outputs; write one per output, or `home`",
                                action.offset_values.size(), outputs));
}

void check_sampler(const Policy& policy, Checker& checker) {
  const Sampler& sampler = *policy.sampler;
  checker.require(sampler.prefix == PrefixUse::none || policy.action.join.kind == JoinKind::prefix,
                  "policy.sampler.prefix",
                  "continues what the executive promises to play, and it promises nothing; write policy.action.join "
                  "{ kind: prefix }, or none here");
  checker.require(!draws_on_path(sampler) || policy.requests_in_flight == 1, "policy.requests_in_flight",
                  fmt::format("is {}, and the sampler draws on the answer before; write 1", policy.requests_in_flight));
  checker.require(sampler.choice == SampleChoice::first || sampler.samples > 1, "policy.sampler.samples",
                  "one sample leaves no choice; write 2 or more, or choice: first");
  checker.require(
      sampler.choice != SampleChoice::first || sampler.samples == 1, "policy.sampler.choice",
      fmt::format("takes the first of {} samples; write coherent or agreed, or samples: 1", sampler.samples));
}

// A tolerance that every state is within asks nothing.
void check_speculation(const RobotConfig& robot, const Speculation& speculation, Checker& checker) {
  for (const Joint& joint : robot.joints) {
    const double range = joint.limits.q_max - joint.limits.q_min;
    checker.require(speculation.position * per_rad(joint) < range / 2, "policy.speculation.position",
                    fmt::format("is half of joint {}'s range of {} {} or more: every assumption would match; lower it",
                                joint.name, range, kJointPosition.unit(joint.kind)));
    checker.require(joint.passive || speculation.velocity * per_rad(joint) < joint.limits.velocity,
                    "policy.speculation.velocity",
                    fmt::format("is no less than joint {}'s limit of {} {}: every assumption would match; lower it",
                                joint.name, joint.limits.velocity, kJointVelocity.unit(joint.kind)));
  }
}

void check_monitors(const ChunkMonitors& monitors, Checker& checker) {
  checker.require(
      monitors.votes <= monitors.of, "policy.monitors.votes",
      fmt::format("{} of {} answers can never be; write at most {}", monitors.votes, monitors.of, monitors.of));
  for (std::size_t i = 0; i < monitors.thresholds.size(); ++i) {
    const auto same = std::ranges::count(monitors.thresholds, monitors.thresholds[i].score, &ChunkThreshold::score);
    checker.require(same == 1, fmt::format("policy.monitors.thresholds[{}].score", i),
                    fmt::format("{} has two thresholds; keep one", name(monitors.thresholds[i].score)));
  }
}

constexpr std::uint32_t channels_of(RosEncoding encoding) {
  switch (encoding) {
    case RosEncoding::mono8:
      return 1;
    case RosEncoding::rgb8:
    case RosEncoding::bgr8:
      return 3;
    case RosEncoding::rgba8:
    case RosEncoding::bgra8:
      return 4;
  }
  return 0;
}

// What does not fit between a sensor and its topic; empty: all fits.
std::string misfit(const Sensor& sensor, const RosTopic& ros) {
  const auto wants = [&](std::size_t values, std::string_view of) {
    if (sensor.image || sensor.values != values)
      return fmt::format("{} gives {} values; write `values: {}`", of, values, values);
    return std::string();
  };
  switch (ros.type) {
    case RosType::image:
      if (!sensor.image) return "an Image is no list of values; write `image`";
      return sensor.image->channels == channels_of(ros.encoding)
                 ? std::string()
                 : fmt::format("its encoding has {} channels, `image` {}; make them equal", channels_of(ros.encoding),
                               sensor.image->channels);
    case RosType::imu:
      return wants(kImuValues, "an Imu");
    case RosType::joint_state:
      return wants(ros.joints.size(), fmt::format("a JointState of {} joints", ros.joints.size()));
    case RosType::twist:
      return sensor.values == 3 ? std::string() : wants(6, "a Twist of more than linear x, linear y, angular z");
  }
  return {};
}

bool is_topic(std::string_view name) {
  const auto fits = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '/';
  };
  return name.size() > 1 && name.front() == '/' && name.back() != '/' && std::ranges::all_of(name, fits);
}

void check_ros(const RobotConfig& robot, const Sensor& sensor, const std::string& path, Checker& checker) {
  checker.require(robot.dds.has_value(), path, "is read in the domain of `dds`; add that section (`dds: {}`)");
  checker.require(is_topic(sensor.ros->topic), path + ".topic",
                  "is no topic; write it as ros2 topic list shows it: /imu/data");
  const std::string wrong = misfit(sensor, *sensor.ros);
  checker.require(wrong.empty(), path + ".type", wrong);
}

void check_size(const RobotConfig& robot, const Policy& policy, Checker& checker) {
  const std::size_t values = policy.steps * robot.joints.size() * field_count(chunk_fields(policy));
  checker.require(values <= kMaxChunkValues, "policy.steps",
                  fmt::format("makes chunks of {} values (steps, joints and fields multiplied), and one holds {}; "
                              "lower it",
                              values, kMaxChunkValues));
}

}  // namespace

void check_sensors(const RobotConfig& robot, Checker& checker) {
  for (std::size_t i = 0; i < robot.sensors.size(); ++i) {
    const Sensor& sensor = robot.sensors[i];
    const std::string path = fmt::format("sensors[{}].command", i);
    checker.require(!sensor.image || sensor.image->bytes() <= kMaxImageBytes, fmt::format("sensors[{}].image", i),
                    fmt::format("has {} bytes; at most {} travel: send a smaller one",
                                sensor.image ? sensor.image->bytes() : 0, kMaxImageBytes));
    checker.require(!sensor.command || !sensor.image, path, "an image is no command; drop one of the two");
    if (sensor.command && !sensor.image) check_command(sensor, path, checker);
    if (sensor.ros) check_ros(robot, sensor, fmt::format("sensors[{}].ros", i), checker);
  }
  if (!robot.imu) return;
  const auto sensor = std::ranges::find(robot.sensors, robot.imu->sensor, &Sensor::name);
  checker.require(sensor == robot.sensors.end() || sensor->values == kImuValues, "imu.sensor",
                  fmt::format("sensor {} has another number of values than an IMU's {}; declare {}", robot.imu->sensor,
                              kImuValues, kImuValues));
}

void check_engine(const Engine& engine, Checker& checker) {
  constexpr std::array<std::string_view, 4> known{"auto", "builtin", "onnxruntime", "torchscript"};
  checker.require(engine.name.contains('/') || std::ranges::find(known, engine.name) != known.end(),
                  "policy.engine.name",
                  fmt::format("knows no engine {}; write auto, builtin, onnxruntime, torchscript, or a plugin's path, "
                              "which has a slash: ./{}",
                              engine.name, engine.name));
  for (std::size_t i = 0; i < engine.shapes.size(); ++i)
    checker.require(std::ranges::all_of(engine.shapes[i].shape, [](double size) { return size == std::floor(size); }),
                    fmt::format("policy.engine.shapes[{}].shape", i), "dimensions are whole numbers; round them");
}

void check_policy(const RobotConfig& robot, Checker& checker) {
  if (!robot.policy) return;
  const Policy& policy = *robot.policy;
  if (policy.engine) check_engine(*policy.engine, checker);
  check_periods(robot, policy, checker);
  check_size(robot, policy, checker);
  check_terms(robot, policy, checker);
  check_meaning(robot, policy, checker);
  check_join(robot, policy, checker);
  check_action(robot, policy.action, checker);
  if (policy.monitors) check_monitors(*policy.monitors, checker);
  if (policy.sampler) check_sampler(policy, checker);
  if (policy.speculation) check_speculation(robot, *policy.speculation, checker);
}

}  // namespace takt::config
