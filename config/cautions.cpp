// SPDX-License-Identifier: Apache-2.0
#include "config/cautions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>
#include <utility>

#include "config/turns.hpp"
#include "config/units.hpp"

namespace takt::config {
namespace {

// A robot that can fall over: it says so by its IMU.
bool may_fall(const RobotConfig& robot) {
  return robot.imu.has_value();
}

void of_turns(const RobotConfig& robot, std::vector<std::string>& lines) {
  for (std::size_t bus = 0; bus < robot.buses.size(); ++bus) {
    std::size_t drives = 0, divided = 0;
    Duration most;
    for (const Joint& joint : robot.joints) {
      if (joint.bus != bus) continue;
      ++drives;
      if (joint.drive.every > 1) ++divided;
      most = std::max(most, turn_of(robot, joint) - robot.control.period);
    }
    if (divided == 0) continue;
    lines.push_back(fmt::format(
        "bus {}: {} of {} drives are written to every few ticks (drive.every): their setpoints act up to {} longer and "
        "what they measured is up to {} older, out of max_age {}; a stop is written at once",
        robot.buses[bus].name, divided, drives, format_duration(most), format_duration(most),
        format_duration(robot.freshness.max_age)));
  }
}

void of_temperatures(const RobotConfig& robot, std::vector<std::string>& lines) {
  std::string joints;
  for (const Joint& joint : robot.joints)
    if (joint.limits.temperature && joint.drive.variant == "tmotor")
      joints += (joints.empty() ? "" : ", ") + joint.name;
  if (!joints.empty())
    lines.push_back(fmt::format(
        "{}: a T-Motor drive tells its temperature in replies of 8 bytes alone; one with 6 is not armed under "
        "limits.temperature",
        joints));
}

// Whose limits hold places that lie a turn apart: its drive may not know which of them it is.
void of_places(const RobotConfig& robot, std::vector<std::string>& lines) {
  std::string joints;
  for (const Joint& joint : robot.joints) {
    const bool is_it = joint.drive.position_after_power_up == PositionAfterPowerUp::within_a_turn;
    const double width = joint.limits.q_max - joint.limits.q_min;
    if (is_it && width >= 2 * std::numbers::pi / joint.drive.gear_ratio)
      joints += (joints.empty() ? "" : ", ") + joint.name;
  }
  if (!joints.empty())
    lines.push_back(
        fmt::format("{}: the drive knows its place within a turn, and limits.position is wider: in doubt it is not "
                    "armed before `takt "
                    "joint home`; a wheel is position_after_power_up: absolute",
                    joints));
}

void of_falls(const RobotConfig& robot, std::vector<std::string>& lines) {
  if (!may_fall(robot)) return;
  if (robot.degraded.behaviour == Degraded::hold)
    lines.push_back(
        "degraded.behaviour: hold, and the base is free: a robot that balances does not stand by it; a "
        "fallback of kind policy goes on balancing");
  const bool none_by_policy =
      std::ranges::none_of(robot.stops, [](const StopConfig& stop) { return stop.how == StopHow::policy; });
  if (fallback_policy_of(robot) != nullptr && none_by_policy)
    lines.push_back(
        "stops: none is by the fallback policy, and the base is free: the robot falls with every damped stop, a "
        "person's too (stops.CAUSE.how: policy)");
}

std::string what_is(FallbackKind kind) {
  switch (kind) {
    case FallbackKind::pose:
      return "a posture";
    case FallbackKind::state_feedback:
      return "state feedback";
    case FallbackKind::policy:
      return "a fallback policy";
  }
  return "a fallback";
}

// Empty: it is not offered as safe.
std::string what_is(StopHow how) {
  switch (how) {
    case StopHow::rest:
    case StopHow::damping:
      return {};
    case StopHow::hold:
      return "hold";
    case StopHow::policy:
      return "the fallback policy";
  }
  return {};
}

}  // namespace

std::vector<std::string> cautions_about(const RobotConfig& robot) {
  std::vector<std::string> lines;
  of_turns(robot, lines);
  of_temperatures(robot, lines);
  of_places(robot, lines);
  of_falls(robot, lines);
  add_cautions_of_values(robot, lines);
  if (std::string stops = stops_without_model(robot); !stops.empty()) lines.push_back(std::move(stops));
  return lines;
}

bool holds_at_once(const RobotConfig& robot) {
  return !robot.model && !may_fall(robot);
}

std::string stops_without_model(const RobotConfig& robot) {
  if (robot.model) return {};
  if (holds_at_once(robot))
    return "no `model`: a stop carries no gravity; each joint that is heard brakes and holds by its stiffness, and "
           "sags "
           "by its load / gains.kp; a stop by damping (stops.CAUSE.how) lets it fall";
  if (fallback_policy_of(robot) != nullptr) return {};  // of_falls says what its stops do
  return "no `model`, and the base is free: a damped stop carries no gravity, and lets the robot fall";
}

std::vector<Offer> offered_as_safe(const RobotConfig& robot) {
  std::vector<Offer> offers;
  if (!may_fall(robot)) return offers;
  const auto fallback = std::ranges::find(robot.fallbacks, robot.degraded.fallback, &Fallback::name);
  if (robot.degraded.behaviour == Degraded::fallback && fallback != robot.fallbacks.end())
    offers.push_back({"fallbacks." + fallback->name, what_is(fallback->kind), fallback->shown_by});
  for (const StopConfig& stop : robot.stops)
    if (const std::string what = what_is(stop.how); !what.empty())
      offers.push_back({"stops." + stop.name, what, stop.shown_by});
  return offers;
}

}  // namespace takt::config
