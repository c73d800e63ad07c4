// SPDX-License-Identifier: Apache-2.0
// A valid two-joint robot with every section, for tests to break in one place at a time.
#pragma once

#include <cassert>
#include <string>
#include <string_view>

namespace takt::config::test {

inline constexpr std::string_view kSmallRobot = R"(schema: takt.robot/1
robot: small
control: { period: 1 ms, priority: 80, cpu: none, wake: sleep, spin: 100 us }
freshness:
  max_age: 120 ms
  epsilon: 0.01
  window: 1 s
  recover_after: 250 ms
  stop_after: 600 ms
feedback: { timeout: 20 ms }
degraded: { behaviour: fallback, fallback: tuck }
fallbacks:
  tuck: { kind: pose, speed: 0.5 rad/s, pose: [0 rad, 10 deg] }
buses:
  - { name: left, interface: can0, when_missing: loopback }
joints:
  - name: hip
    bus: left
    drive: { protocol: mit, variant: tmotor, model: AK10-9, id: 1, reply_id: 0, position_after_power_up: absolute }
    limits:
      position: [-1 rad, 1 rad]
      position_margin: 0.1 rad
      velocity: 2 rad/s
      velocity_hard: 4 rad/s
      acceleration: 10 rad/s2
      torque: 12 Nm
      torque_rate: 900 Nm/s
      kp: 100 Nm/rad
      kd: 3 Nms/rad
    gains: { kp: 60 Nm/rad, kd: 2 Nms/rad, damping: 2 Nms/rad }
    inertia: 0.1 kgm2
  - name: knee
    bus: left
    drive: { protocol: mit, variant: tmotor, id: 0x02, reply_id: 0, direction: -1, position_range: 12.5 rad, velocity_range: 50 rad/s, torque_range: 18 Nm, kp_range: 500 Nm/rad, kd_range: 5 Nms/rad, position_after_power_up: absolute }
    limits: { position: [-90 deg, 90 deg], position_margin: 5 deg, velocity: 3 rad/s, velocity_hard: 6 rad/s, acceleration: 20 rad/s2, torque: 8 Nm, torque_rate: 900 Nm/s, kp: 80 Nm/rad, kd: 3 Nms/rad }
    gains: { kp: 40 Nm/rad, kd: 1 Nms/rad, damping: 1 Nms/rad }
    inertia: 0.05 kgm2
    home: 0.2 rad
model:
  links:
    - { joint: hip, parent: base, origin: { xyz: [0 m, 0 m, 100 mm] }, axis: [0, 2, 0], mass: 1 kg, com: [0 m, 0 m, 0.1 m], inertia: [0.01 kgm2, 0.01 kgm2, 0.002 kgm2] }
    - { joint: knee, parent: hip, origin: { xyz: [0 m, 0 m, 0.2 m], rpy: [90 deg, 0 deg, 0 deg] }, axis: [0, 0, 1], mass: 0.5 kg, com: [0 m, 0 m, 0.1 m], inertia: [0.01 kgm2, 0.01 kgm2, 0.002 kgm2] }
  tool: { link: knee, xyz: [0 m, 0 m, 0.2 m] }
sensors:
  - { name: target, values: 3, timeout: 100 ms }
policy:
  file: small.onnx
  period: 20 ms
  step_period: 10 ms
  steps: 8
  joint_order: [knee, hip]
  observation:
    - { term: joint_position_relative, history: 2 }
    - { term: sensor, sensor: target, scale: [1, 1, 0.5] }
    - { term: constant, values: [0.5] }
    - { term: last_action }
  action: { scale: [0.25, 0.5], offset: home }
simulation:
  step: 500 us
  camera: { sensor: target, period: 33 ms, delay: 18 ms, jitter: 4 ms }
  target: { centre: [0.3 m, 0 m, 0.3 m], amplitude: [0 m, 0.1 m, 0.1 m], frequency: [0 Hz, 0.1 Hz, 0.2 Hz] }
)";

// The robot with the first `from` replaced by `to`; `from` must be in it.
inline std::string with(std::string_view from, std::string_view to) {
  std::string text(kSmallRobot);
  const std::size_t at = text.find(from);
  if (at == std::string::npos) return "the test's `from` is not in the small robot: " + std::string(from);
  return text.replace(at, from.size(), to);
}

}  // namespace takt::config::test
