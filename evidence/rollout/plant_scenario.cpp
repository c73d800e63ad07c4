// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/plant_scenario.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "evidence/rollout/random.hpp"
#include "evidence/rollout/troubled_dynamics.hpp"

namespace takt::evidence {
namespace {

constexpr std::uint64_t kLyingJointStream = 801;

std::string event(Duration at, const std::string& what, Duration length) {
  return fmt::format("  - {{ after: enabled, at: {} us, {}, for: {} us }}\n", at.ns / 1000, what, length.ns / 1000);
}

std::string whole_window(const Perturbation& perturbation, const std::string& what) {
  return event(perturbation.from, what, perturbation.length);
}

// Once per second of the window; `what` of the second, from 1.
template <class What>
std::string every_second(const Perturbation& perturbation, Duration length, const What& what) {
  std::string events;
  std::int64_t turn = 0;
  for (Duration at; at < perturbation.length; at = at + kRepeat)
    events += event(perturbation.from + at, what(++turn), std::min(length, perturbation.length - at));
  return events;
}

std::string with_head(const std::string& events) {
  return "schema: takt.scenario/1\nevents:\n" + events;
}

Duration dose_time(const Perturbation& perturbation) {
  return {std::llround(perturbation.dose * 1e6)};
}

std::string dose_text(const Perturbation& perturbation) {
  return fmt::format("{} us", dose_time(perturbation).ns / 1000);
}

std::string push_text(double force_N, const config::Vector3& along) {
  return fmt::format("push: {} N, along: [{}, {}, {}]", force_N, along[0], along[1], along[2]);
}

std::string at_body(const Perturbation& perturbation) {
  return perturbation.body.empty() ? "" : ", body: " + perturbation.body;
}

}  // namespace

std::vector<std::string> simulated_sensors(const config::RobotConfig& robot) {
  std::vector<std::string> names;
  if (!robot.simulation) return names;
  if (!robot.simulation->camera_sensor.empty()) names.push_back(robot.simulation->camera_sensor);
  if (robot.imu && robot.simulation->mujoco) names.push_back(robot.imu->sensor);
  return names;
}

std::string bus_scenario(const Perturbation& perturbation, const config::RobotConfig& robot) {
  if (perturbation.trouble == Trouble::bus_off) {
    const std::string off = fmt::format("bus: {}, fault: bus_off", robot.buses.front().name);
    return with_head(event(perturbation.from, off, dose_time(perturbation)));
  }
  std::string events;
  if (perturbation.trouble == Trouble::can_delay)
    for (const config::Joint& joint : robot.joints)
      events += whole_window(perturbation, fmt::format("joint: {}, delay: {}", joint.name, dose_text(perturbation)));
  if (perturbation.trouble == Trouble::can_loss)
    for (const config::Bus& bus : robot.buses)
      events += whole_window(perturbation, fmt::format("bus: {}, drop: {}", bus.name, perturbation.dose));
  return with_head(events);
}

std::size_t lying_joint(const config::RobotConfig& robot, std::uint64_t seed) {
  std::vector<std::size_t> driven;
  for (std::size_t j = 0; j < robot.joints.size(); ++j)
    if (!robot.joints[j].passive) driven.push_back(j);
  Random draw(simulation::seed_for(seed, kLyingJointStream), 0);
  return driven[draw.below(driven.size())];
}

std::string feedback_scenario(const Perturbation& perturbation, const config::RobotConfig& robot, std::uint64_t seed) {
  std::string lie;
  if (perturbation.trouble == Trouble::feedback_frozen) lie = "fault: frozen_position";
  if (perturbation.trouble == Trouble::feedback_repeated) lie = "fault: freeze";
  if (perturbation.trouble == Trouble::feedback_reversed) lie = "fault: reversed";
  if (perturbation.trouble == Trouble::feedback_jump) lie = fmt::format("jump: {} rad", perturbation.dose);
  if (perturbation.trouble == Trouble::feedback_scale) lie = fmt::format("scale: {}", perturbation.dose);
  const std::string& joint = robot.joints[lying_joint(robot, seed)].name;
  return with_head(whole_window(perturbation, fmt::format("joint: {}, {}", joint, lie)));
}

std::string sensor_scenario(const Perturbation& perturbation, const config::RobotConfig& robot) {
  std::string events;
  for (const std::string& name : simulated_sensors(robot)) {
    const std::string sensor = "sensor: " + name;
    if (perturbation.trouble == Trouble::camera_freeze)
      events +=
          every_second(perturbation, dose_time(perturbation), [&](std::int64_t) { return sensor + ", fault: freeze"; });
    if (perturbation.trouble == Trouble::sensor_burst)
      events += whole_window(perturbation, fmt::format("{}, burst: {}", sensor, dose_text(perturbation)));
    if (perturbation.trouble == Trouble::sensor_dropout)
      events += whole_window(perturbation, fmt::format("{}, drop: {}", sensor, perturbation.dose));
    if (perturbation.trouble == Trouble::sensor_lies)
      events += whole_window(perturbation, fmt::format("{}, lies: {}", sensor, perturbation.dose));
  }
  return with_head(events);
}

std::string body_scenario(const Perturbation& perturbation, std::uint64_t seed) {
  if (perturbation.trouble == Trouble::push)
    return with_head(every_second(perturbation, kPushLength, [&](std::int64_t turn) {
      return push_text(perturbation.dose, push_direction(seed, turn)) + at_body(perturbation);
    }));
  const std::string what = perturbation.trouble == Trouble::payload
                               ? fmt::format("payload: {} kg{}", perturbation.dose, at_body(perturbation))
                               : fmt::format("friction: {}", perturbation.dose);
  return with_head(whole_window(perturbation, what));
}

}  // namespace takt::evidence
