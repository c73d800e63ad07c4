#include "config/checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "config/units.hpp"

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
  check_policy(robot, checker);
  check_fallbacks(robot, checker);
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

void check_fallbacks(const RobotConfig& robot, Checker& checker) {
  if (robot.degraded.behaviour == Degraded::fallback)
    checker.require(!robot.degraded.fallback.empty(), "degraded.fallback",
                    "none, but behaviour is `fallback`; name an entry of `fallbacks`");
  for (const Fallback& fallback : robot.fallbacks) {
    const std::string path = fmt::format("fallbacks.{}", fallback.name);
    for (std::size_t j = 0; j < robot.joints.size() && j < fallback.pose.size(); ++j) {
      const Joint& joint = robot.joints[j];
      checker.require(fallback.pose[j] >= joint.limits.q_min && fallback.pose[j] <= joint.limits.q_max, path + ".pose",
                      fmt::format("{:.4g} rad for {} is outside its limits [{:.4g}, {:.4g}] rad; move it inside",
                                  fallback.pose[j], joint.name, joint.limits.q_min, joint.limits.q_max));
      checker.require(fallback.speed <= joint.limits.velocity, path + ".speed",
                      fmt::format("{} rad/s exceeds the velocity limit {} rad/s of {}; lower it", fallback.speed,
                                  joint.limits.velocity, joint.name));
    }
  }
}

// Both end up in Cyclone DDS's configuration text, where other characters would mean something else.
void check_dds(const RobotConfig& robot, Checker& checker) {
  if (!robot.dds) return;
  const Dds& dds = *robot.dds;
  const auto is_plain = [](std::string_view text) {
    return std::ranges::all_of(text, [](unsigned char c) {
      return std::isalnum(c) != 0 || std::string_view(".:_-").find(static_cast<char>(c)) != std::string_view::npos;
    });
  };
  constexpr std::string_view kPlain = "has a character that no {} has; write letters, digits, `.`, `:`, `_` and `-`";
  checker.require(is_plain(dds.interface), "dds.interface", fmt::format(kPlain, "interface"));
  for (std::size_t i = 0; i < dds.peers.size(); ++i)
    checker.require(is_plain(dds.peers[i].address), fmt::format("dds.peers[{}].address", i),
                    fmt::format(kPlain, "host"));
  checker.require(dds.multicast || !dds.peers.empty() || dds.interface == "lo", "dds.interface",
                  "nobody can be found on it; add `peers`, or `multicast: true`");
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
  checker.require(robot.model.has_value(), "simulation", "needs rigid bodies; add a `model` section");
  checker.require(simulation.step.ns <= period.ns && period.ns % simulation.step.ns == 0, "simulation.step",
                  fmt::format("control.period {} is no whole number of steps of {}; choose a divisor",
                              format_duration(period), format_duration(simulation.step)));
  checker.require(simulation.drive_watchdog.ns >= 2 * period.ns, "simulation.drive_watchdog",
                  fmt::format("{} must be at least two control periods of {}; raise it",
                              format_duration(simulation.drive_watchdog), format_duration(period)));
  if (simulation.camera_sensor.empty()) return;
  const auto sensor = std::ranges::find(robot.sensors, simulation.camera_sensor, &Sensor::name);
  checker.require(sensor == robot.sensors.end() || sensor->values == 3, "simulation.camera.sensor",
                  fmt::format("the camera gives a position of 3 values; sensor `{}` has another number; declare 3",
                              simulation.camera_sensor));
  checker.require(simulation.camera_jitter <= simulation.camera_period, "simulation.camera.jitter",
                  fmt::format("{} exceeds the period {}; samples would overtake one another; lower it",
                              format_duration(simulation.camera_jitter), format_duration(simulation.camera_period)));
}

}  // namespace takt::config
