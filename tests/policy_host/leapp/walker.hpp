// SPDX-License-Identifier: Apache-2.0
// The LEAPP bundle that make_bundle.py writes, and the robot file that `takt config import` begins for it, filled in as
// its owner would: hardware, contract, and the sensor for what no robot says of itself.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "config/deploy_import.hpp"
#include "config/document.hpp"
#include "config/load.hpp"
#include "policy_host/described_import.hpp"
#include "policy_host/leapp/leapp_bundle.hpp"
#include "policy_host/leapp/leapp_description.hpp"

namespace takt::policy_host {

// Into `folder`; of the shapes of `source`, a bundle's YAML, "history" or "t1", or the walker's. The YAML's path.
inline std::string make_bundle(const std::string& folder, const std::string& source = "") {
  const std::string command = "/usr/bin/python3 tests/policy_host/leapp/make_bundle.py " + folder + " " + source;
  FILE* const script = popen(command.c_str(), "r");
  char path[512] = {};
  const bool said = script != nullptr && std::fgets(path, sizeof(path), script) != nullptr;
  if (script == nullptr || pclose(script) != 0 || !said)
    throw std::runtime_error("make_bundle.py failed; it needs python3-onnx, python3-yaml and python3-numpy");
  std::string text(path);
  text.pop_back();  // newline
  return text;
}

inline DescribedPolicy described_bundle(const std::string& yaml) {
  const auto text = config::read_file(yaml);
  const auto bundle = text ? read_leapp_bundle(*text, yaml) : std::unexpected(text.error());
  if (!bundle) throw std::runtime_error(bundle.error());
  return describe_leapp(*bundle);
}

// What `takt config import` writes. `joints`: the robot's order; empty: the policy's.
inline std::string imported_bundle(const std::string& yaml, std::vector<std::string> joints = {}) {
  const auto deploy = deploy_file_of(described_bundle(yaml), joints);
  if (!deploy) throw std::runtime_error(deploy.error());
  const auto robot = config::import_deploy_file(
      *deploy, {.robot = "walker", .policy_file = yaml, .joint_names = joints, .source = "walk.yaml"});
  if (!robot) throw std::runtime_error(robot.error());
  return *robot;
}

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  if (text.find(from) == std::string::npos) throw std::runtime_error("nothing says " + from);
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

// Of a robot of at most 32 joints: eight buses, four joints each. What no export of these leaves open is passed over.
inline std::string filled_in(std::string text) {
  const std::pair<const char*, const char*> said[] = {
      {"max_age: FILL_IN", "max_age: 60 ms"},
      {"epsilon: FILL_IN", "epsilon: 0.05"},
      {"recover_after: FILL_IN", "recover_after: 100 ms"},
      {"stop_after: FILL_IN", "stop_after: 400 ms"},
      {"behaviour: FILL_IN", "behaviour: hold, after: 10 ms"},
      {"feedback: { timeout: FILL_IN }", "feedback: { timeout: 30 ms }\ncontrol: { period: 2 ms }"},
      {"protocol: FILL_IN, variant: FILL_IN, model: FILL_IN",
       "protocol: mit, variant: damiao, position_range: 12.5 rad, velocity_range: 60 rad/s, torque_range: 200 Nm, "
       "kp_range: 500 Nm/rad, kd_range: 100 Nms/rad"},
      {"position_margin: FILL_IN", "position_margin: 1 rad"},
      {"velocity: FILL_IN", "velocity: 20 rad/s"},
      {"velocity_hard: FILL_IN", "velocity_hard: 55 rad/s"},
      {"acceleration: FILL_IN", "acceleration: 500 rad/s2"},
      {"torque_rate: FILL_IN", "torque_rate: 200000 Nm/s"},
      {"position: [FILL_IN, FILL_IN]", "position: [-4 rad, 4 rad]"},
      {"torque: FILL_IN, kp: FILL_IN, kd: FILL_IN", "torque: 150 Nm, kp: 45 Nm/rad, kd: 42 Nms/rad"},
      {"torque: FILL_IN", "torque: 150 Nm"},
      {"gains: { kp: FILL_IN, kd: FILL_IN, damping: FILL_IN }",
       "gains: { kp: 40 Nm/rad, kd: 4 Nms/rad, damping: 4 Nms/rad }"},
      {"inertia: FILL_IN", "inertia: 0.1 kgm2"},
      {"home: FILL_IN", "home: 0.1 rad"},
      {"values: 3\n    timeout: FILL_IN\n    command: { minimum: FILL_IN, maximum: FILL_IN, when_absent: FILL_IN",
       "values: 3\n    timeout: 50 ms\n    command: { minimum: [-1, -1, -1], maximum: [1, 1, 1], when_absent: [0, 0, "
       "0]"},
      {"minimum: FILL_IN, maximum: FILL_IN, when_absent: FILL_IN",
       "minimum: [-1, -1, -1, -1], maximum: [1, 1, 1, 1], when_absent: [0, 0, 0, 0.5]"},
      {"values: 4\n    timeout: FILL_IN", "values: 4\n    timeout: 50 ms"},
      {"name: imu, values: 10, timeout: FILL_IN",
       "name: odometry, values: 3, unit: m/s, frame: base, timeout: 40 ms }\n  - { name: imu, values: 10, timeout: 40 "
       "ms"},
      {"tilt: FILL_IN", "tilt: 1 rad"},
  };
  for (const auto& [from, to] : said)
    if (text.find(from) != std::string::npos) text = replaced(std::move(text), from, to);
  if (text.find("sensor, sensor: FILL_IN") != std::string::npos)
    text = replaced(std::move(text), "sensor, sensor: FILL_IN", "sensor, sensor: odometry");
  std::string buses;
  for (int bus = 0; bus < 8; ++bus)
    buses += fmt::format("  - {{ name: bus{0}, interface: can{0}, when_missing: loopback }}\n", bus);
  text = replaced(std::move(text), "  - { name: FILL_IN, interface: FILL_IN }\n", buses);
  for (int joint = 0; text.find("bus: FILL_IN") != std::string::npos; ++joint) {
    const std::string open = "bus: FILL_IN\n    drive: { id: FILL_IN, reply_id: FILL_IN }";
    text.replace(
        text.find(open), open.size(),
        fmt::format("bus: bus{}\n    drive: {{ id: {}, reply_id: {} }}", joint / 4, 1 + joint % 4, 17 + joint % 4));
  }
  return text;
}

inline config::RobotConfig loaded(const std::string& folder, const std::string& text) {
  std::ofstream(folder + "/robot.yaml") << text;
  auto robot = config::load(folder + "/robot.yaml");
  if (!robot) throw std::runtime_error(robot.error());
  return *std::move(robot);
}

}  // namespace takt::policy_host
