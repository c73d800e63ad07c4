// SPDX-License-Identifier: Apache-2.0
#include "config/checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "config/joint_units.hpp"
#include "config/observation_shape.hpp"
#include "config/stop_causes.hpp"
#include "config/turns.hpp"
#include "config/units.hpp"
#include "executive/contract/observation.hpp"

namespace takt::config {
void Checker::require(bool holds, const std::string& path, std::string_view sentence) {
  if (holds) return;
  constexpr std::string_view kJoints = "joints[";
  const std::string named = path.starts_with(kJoints) ? joints_key_ + path.substr(kJoints.size() - 1) : path;
  const auto place = places_.find(named);
  problems_.add(place == places_.end() ? Place{} : place->second, fmt::format("{}: {}", named, sentence));
}

void check(const RobotConfig& robot, const Places& places, Problems& problems) {
  Checker checker(places, problems);
  check_timing(robot, checker);
  check_buses_and_ids(robot, checker);
  check_drives(robot, checker);
  check_joints(robot, checker);
  check_model(robot, checker);
  check_sensors(robot, checker);
  check_policy(robot, checker);
  check_fallbacks(robot, checker);
  check_stops(robot, checker);
  check_dds(robot, checker);
  check_telemetry(robot, checker);
  check_simulation(robot, checker);
}

void check_timing(const RobotConfig& robot, Checker& checker) {
  const Duration period = robot.control.period;
  const Freshness& f = robot.freshness;
  const auto text = [](Duration d) { return format_duration(d); };
  if (robot.control.wake == WakeMode::hybrid)
    checker.require(robot.control.spin < period, "control.spin",
                    fmt::format("{} is not shorter than control.period {}; the loop would never sleep",
                                text(robot.control.spin), text(period)));
  checker.require(f.stop_after > f.max_age, "freshness.stop_after",
                  fmt::format("{} must exceed max_age {}; raise it", text(f.stop_after), text(f.max_age)));
  checker.require(f.recover_after >= period, "freshness.recover_after",
                  fmt::format("{} must be at least control.period {}; raise it", text(f.recover_after), text(period)));
  checker.require(f.max_age > period, "freshness.max_age",
                  fmt::format("{} must exceed control.period {}; raise it", text(f.max_age), text(period)));
  const Duration every = robot.policy ? robot.policy->period : period;
  const std::int64_t remembered = observations_to_remember(f.max_age, every);
  checker.require(
      remembered <= kMaxRememberedObservations, "freshness.max_age",
      fmt::format("{} with an observation every {} means remembering {} of them; at most {} are: lower it, or "
                  "raise policy.period",
                  text(f.max_age), text(every), remembered, kMaxRememberedObservations));
  checker.require(
      f.window.ns % period.ns == 0, "freshness.window",
      fmt::format("{} is no whole number of control periods of {}; choose a multiple", text(f.window), text(period)));
  const std::int64_t ticks = f.window.ns / period.ns;
  checker.require(
      ticks >= 1 && ticks <= kMaxWindowTicks, "freshness.window",
      fmt::format("{} / {} = {} ticks; write 1 to {} ticks", text(f.window), text(period), ticks, kMaxWindowTicks));
  checker.require(robot.feedback.timeout.ns >= 2 * period.ns, "feedback.timeout",
                  fmt::format("{} must be at least two control periods of {}; raise it", text(robot.feedback.timeout),
                              text(period)));
  checker.require(robot.bus_faults.window.ns >= 10 * period.ns, "bus_faults.window",
                  fmt::format("{} must be at least ten control periods of {}; raise it", text(robot.bus_faults.window),
                              text(period)));
  checker.require(robot.feedback.enable_timeout > robot.feedback.timeout, "feedback.enable_timeout",
                  fmt::format("{} must exceed feedback.timeout {}; raise it", text(robot.feedback.enable_timeout),
                              text(robot.feedback.timeout)));
}

namespace {

// Exactly one row per driven joint: a joint without one would hang limp beside the others.
void check_feedback_rows(const RobotConfig& robot, const Fallback& fallback, const std::string& path,
                         Checker& checker) {
  for (std::size_t i = 0; i < fallback.gains.size(); ++i) {
    const std::size_t joint = fallback.gains[i].joint;
    const std::string row = fmt::format("{}.gains[{}].joint", path, i);
    checker.require(!robot.joints[joint].passive, row,
                    fmt::format("{} is passive and takes no torque; drop the row", robot.joints[joint].name));
    const auto rows = std::ranges::count(fallback.gains, joint, &FeedbackRow::joint);
    checker.require(rows == 1, row, fmt::format("{} has {} rows; keep one", robot.joints[joint].name, rows));
  }
  for (std::size_t j = 0; j < robot.joints.size(); ++j)
    checker.require(
        robot.joints[j].passive || std::ranges::find(fallback.gains, j, &FeedbackRow::joint) != fallback.gains.end(),
        path + ".gains", fmt::format("has no row for {}; every driven joint needs one", robot.joints[j].name));
}

// What a fallback policy reads in place of a person's command, and whether it can take over before the robot stops.
void check_fallback_policy(const RobotConfig& robot, const Fallback& fallback, const std::string& path,
                           Checker& checker) {
  checker.require(robot.policy.has_value(), path, "a second policy needs a first one; add `policy`");
  if (!robot.policy) return;
  for (const ObservationTerm& term : robot.policy->observation) {
    const std::size_t width = term.kind == TermKind::command ? term_width(robot, term) : fallback.command.size();
    checker.require(fallback.command.size() == width, path + ".command",
                    fmt::format("has {} values, the policy's observation term `command` {}; write one each",
                                fallback.command.size(), width));
  }
  const bool reads_command = std::ranges::any_of(
      robot.policy->observation, [](const ObservationTerm& term) { return term.kind == TermKind::command; });
  checker.require(reads_command || fallback.command.empty(), path + ".command",
                  "the policy has no observation term `command`; drop it");
  const Freshness& contract = robot.freshness;
  const Duration by_share{static_cast<std::int64_t>(contract.epsilon * static_cast<double>(contract.window.ns))};
  const Duration after = robot.degraded.after;
  const Duration bound = after.ns > 0 ? std::min(after, by_share) : by_share;
  checker.require(bound < contract.stop_after, path,
                  fmt::format("takes over {} after the last usable command, when freshness.stop_after {} has stopped "
                              "the robot; set degraded.after",
                              format_duration(bound), format_duration(contract.stop_after)));
}

void check_cart_pole(const RobotConfig& robot, const CartPole& machine, Checker& checker) {
  const bool fits = robot.joints.size() == 2 && !robot.joints[0].passive && robot.joints[1].passive;
  checker.require(fits, "simulation.cart_pole",
                  "needs two joints: the cart's, driven, and the pole's, `passive: true`; correct `joints`");
  checker.require(!robot.model.has_value(), "simulation.cart_pole",
                  "stands beside a `model`: the simulator would not know which to move; drop one");
  checker.require(
      machine.pole_com <= machine.pole_length, "simulation.cart_pole.pole_com",
      fmt::format("{:.4g} m lies beyond pole_length {:.4g} m; lower it", machine.pole_com, machine.pole_length));
}

// What the camera sees is a point in space, or where the cart is told to be.
void check_camera(const RobotConfig& robot, const Simulation& simulation, Checker& checker) {
  const bool steps = simulation.target == TargetKind::steps;
  checker.require(steps == simulation.cart_pole.has_value(), "simulation.target.kind",
                  steps ? "steps are commands to a cart; add `cart_pole`, or write `lissajous`"
                        : "a cart is told where to go by `steps`; write `steps`");
  const std::uint32_t values = steps ? 1 : 3;
  const auto sensor = std::ranges::find(robot.sensors, simulation.camera_sensor, &Sensor::name);
  checker.require(sensor == robot.sensors.end() || sensor->values == values, "simulation.camera.sensor",
                  fmt::format("the camera gives a position of {} value{}; sensor `{}` has another number; declare {}",
                              values, values == 1 ? "" : "s", simulation.camera_sensor, values));
  checker.require(simulation.camera_jitter <= simulation.camera_period, "simulation.camera.jitter",
                  fmt::format("{} exceeds the period {}; samples would overtake one another; lower it",
                              format_duration(simulation.camera_jitter), format_duration(simulation.camera_period)));
}

}  // namespace

void check_fallbacks(const RobotConfig& robot, Checker& checker) {
  checker.require(robot.degraded.after < robot.freshness.stop_after, "degraded.after",
                  fmt::format("{} is not shorter than freshness.stop_after {}: the robot would stop before; lower it",
                              format_duration(robot.degraded.after), format_duration(robot.freshness.stop_after)));
  if (robot.degraded.behaviour == Degraded::fallback)
    checker.require(!robot.degraded.fallback.empty(), "degraded.fallback",
                    "none, but behaviour is `fallback`; name an entry of `fallbacks`");
  for (const Fallback& fallback : robot.fallbacks) {
    const std::string path = fmt::format("fallbacks.{}", fallback.name);
    if (fallback.kind == FallbackKind::state_feedback) check_feedback_rows(robot, fallback, path, checker);
    if (fallback.kind == FallbackKind::policy) check_fallback_policy(robot, fallback, path, checker);
    for (std::size_t j = 0; j < robot.joints.size() && j < fallback.pose.size(); ++j) {
      const Joint& joint = robot.joints[j];
      checker.require(fallback.pose[j] >= joint.limits.q_min && fallback.pose[j] <= joint.limits.q_max, path + ".pose",
                      fmt::format("{0:.4g} {4} for {1} is outside its limits [{2:.4g}, {3:.4g}] {4}; move it inside",
                                  fallback.pose[j], joint.name, joint.limits.q_min, joint.limits.q_max,
                                  kJointPosition.unit(joint.kind)));
      const bool slides = joint.kind == JointKind::slide;
      const double speed = slides ? fallback.slide_speed : fallback.speed;
      checker.require(joint.passive || speed <= joint.limits.velocity, path + (slides ? ".slide_speed" : ".speed"),
                      fmt::format("{0} {3} exceeds the velocity limit {1} {3} of {2}; lower it", speed,
                                  joint.limits.velocity, joint.name, kJointVelocity.unit(joint.kind)));
    }
  }
}

void check_stop_by_policy(const RobotConfig& robot, const StopConfig& stop, const std::string& path, Checker& checker) {
  checker.require(fallback_policy_of(robot) != nullptr, path + ".how",
                  "policy, and the robot has no fallback policy; name one of kind `policy` in degraded.fallback, or "
                  "write another way");
  std::string able;
  for (const Cause cause : kPolicyStopCauses) able += (able.empty() ? "" : ", ") + std::string(name(cause));
  checker.require(std::ranges::find(kPolicyStopCauses, stop_cause_named(stop.name)) != kPolicyStopCauses.end(),
                  path + ".how", fmt::format("policy is for {} alone; write another way", able));
}

void check_stops(const RobotConfig& robot, Checker& checker) {
  for (const StopConfig& stop : robot.stops) {
    const std::string path = fmt::format("stops.{}", stop.name);
    checker.require(stop_cause_named(stop.name) != Cause::none, path,
                    "is no cause of a damped stop; docs/hazards.md names them: operator_stop, command_lost, tilt, ...");
    if (stop.how == StopHow::policy) check_stop_by_policy(robot, stop, path, checker);
  }
}

// These end up in Cyclone DDS's configuration text, where other characters would mean something else.
void check_dds(const RobotConfig& robot, Checker& checker) {
  if (!robot.dds) return;
  const Dds& dds = *robot.dds;
  const auto is_plain = [](std::string_view text, std::string_view others = ".:_-") {
    return std::ranges::all_of(text, [others](unsigned char c) {
      return std::isalnum(c) != 0 || others.find(static_cast<char>(c)) != std::string_view::npos;
    });
  };
  constexpr std::string_view kPlain = "has a character that no {} has; write letters, digits, `.`, `:`, `_` and `-`";
  checker.require(is_plain(dds.interface), "dds.interface", fmt::format(kPlain, "interface"));
  for (std::size_t i = 0; i < dds.peers.size(); ++i)
    checker.require(is_plain(dds.peers[i].address), fmt::format("dds.peers[{}].address", i),
                    fmt::format(kPlain, "host"));
  checker.require(dds.multicast || !dds.peers.empty() || dds.interface == "lo", "dds.interface",
                  "no participant can be found on it; add `peers`, or `multicast: true`");
  checker.require(dds.security.empty() || (dds.security.starts_with('/') && is_plain(dds.security, "/._-")),
                  "dds.security", "is no absolute path of letters, digits, `/`, `.`, `_` and `-`");
}

void check_telemetry(const RobotConfig& robot, Checker& checker) {
  if (!robot.otlp) return;
  const Otlp& otlp = *robot.otlp;
  checker.require(otlp.file || !otlp.endpoint.empty(), "otlp",
                  "neither a file nor an endpoint: nothing would be exported; set one, or leave the section out");
  checker.require(
      otlp.endpoint.empty() || otlp.endpoint.starts_with("http://") || otlp.endpoint.starts_with("https://"),
      "otlp.endpoint", "is no address of an OTLP/HTTP receiver; write http://host:4318");
}

void check_simulation(const RobotConfig& robot, Checker& checker) {
  if (!robot.simulation) return;
  const Simulation& simulation = *robot.simulation;
  const Duration period = robot.control.period;
  checker.require(robot.model.has_value() || simulation.cart_pole.has_value() || simulation.mujoco.has_value(),
                  "simulation", "needs rigid bodies; add a `model` section, or `simulation.mujoco`");
  checker.require(!simulation.cart_pole || !simulation.mujoco, "simulation.mujoco",
                  "stands beside `cart_pole`: the simulator would not know which to move; drop one");
  if (simulation.cart_pole) check_cart_pole(robot, *simulation.cart_pole, checker);
  checker.require(simulation.step.ns <= period.ns && period.ns % simulation.step.ns == 0, "simulation.step",
                  fmt::format("control.period {} is no whole number of steps of {}; choose a divisor",
                              format_duration(period), format_duration(simulation.step)));
  Duration turn = period;
  for (const Joint& joint : robot.joints) turn = std::max(turn, turn_of(robot, joint));
  checker.require(
      simulation.drive_watchdog.ns >= 2 * turn.ns, "simulation.drive_watchdog",
      fmt::format("{} must be at least two {} of {}; raise it", format_duration(simulation.drive_watchdog),
                  turn == period ? "control periods" : "turns of its slowest drive", format_duration(turn)));
  if (!simulation.camera_sensor.empty()) check_camera(robot, simulation, checker);
}

}  // namespace takt::config
