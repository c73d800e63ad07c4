// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/cause_detail.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <utility>

#include "config/joint_units.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::drivers {
namespace {

// What is wrong with a joint or a bus; empty: nothing.
using OfJoint = std::function<std::string(const JointRecord&, const config::Joint&)>;
using OfBus = std::function<std::string(const BusHealth&)>;

// A controller whose driver does not restart it stays off until it is brought up anew.
std::string left_bus(const config::RobotConfig& robot, const config::Bus& bus) {
  if (bus.when_missing == config::WhenBusMissing::loopback)
    return "bus-off; a simulated bus comes back by its scenario, a real one, where it stays off, by: takt bus up "
           "--robot " +
           robot.file + " --interface " + bus.interface;
  return "bus-off; where it stays off, this restarts it: takt bus up --robot " + robot.file + " --interface " +
         bus.interface;
}

void add(CauseFindings& found, CauseFinding finding) {
  if (!finding.what.empty()) found.push_back(std::move(finding));
}

CauseFindings joints_where(const TickRecord& record, const config::RobotConfig& robot, const OfJoint& wrong) {
  CauseFindings found;
  const std::size_t count = std::min<std::size_t>(record.header.joint_count, robot.joints.size());
  for (std::size_t j = 0; j < count; ++j) add(found, {CausePlace::joint, j, wrong(record.joints[j], robot.joints[j])});
  return found;
}

CauseFindings buses_where(const TickRecord& record, const config::RobotConfig& robot, const OfBus& wrong) {
  CauseFindings found;
  const std::size_t count = std::min<std::size_t>(record.header.bus_count, robot.buses.size());
  for (std::size_t b = 0; b < count; ++b) add(found, {CausePlace::bus, b, wrong(record.header.buses[b])});
  return found;
}

CauseFindings buses_off(const TickRecord& record, const config::RobotConfig& robot) {
  CauseFindings found;
  const std::size_t count = std::min<std::size_t>(record.header.bus_count, robot.buses.size());
  for (std::size_t b = 0; b < count; ++b)
    if (record.header.buses[b].state == BusState::bus_off)
      found.push_back({CausePlace::bus, b, left_bus(robot, robot.buses[b])});
  return found;
}

std::string digits(double number, int after_point) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.*f", after_point, number);
  return text.data();
}

// "0.250 rad", of a slide "0.250 m".
std::string with_unit(double number, int after_point, const config::JointQuantity& quantity, const config::Joint& of) {
  return digits(number, after_point) + " " + std::string(quantity.unit(of.kind));
}

CauseFindings drive_errors(const TickRecord& record, const config::RobotConfig& robot) {
  CauseFindings found;
  const std::size_t count = std::min<std::size_t>(record.header.joint_count, robot.joints.size());
  for (std::size_t j = 0; j < count; ++j) {
    const JointFeedback& feedback = record.joints[j].feedback;
    if (feedback.drive_state != DriveState::fault && feedback.error_code == 0) continue;
    found.push_back(
        {CausePlace::joint, j,
         feedback.error_code == 0 ? "the drive reports a fault" : error_text(robot, j, feedback.error_code)});
  }
  return found;
}

std::string refused_frame(const JointRecord& joint, const config::Joint& /*known*/) {
  const auto verdict = static_cast<std::size_t>(joint.feedback.refused);
  if (!is_bug(joint.feedback.refused) || verdict >= kWireVerdictCount) return {};
  return "the last guard refused a frame: " + std::string(kWireVerdictNames[verdict]);
}

std::string outside(const JointRecord& joint, const config::Joint& known) {
  const config::Limits& limits = known.limits;
  const double q = joint.feedback.q;
  if (q < limits.q_min - limits.position_margin || q > limits.q_max + limits.position_margin)
    return "at " + with_unit(q, 3, config::kJointPosition, known) + ", outside its limits and margin";
  if (std::abs(joint.dq_estimate) > limits.velocity_hard)
    return "at " + with_unit(joint.dq_estimate, 3, config::kJointVelocity, known) + ", faster than velocity_hard";
  return {};
}

std::string hot(const JointFeedback& feedback, double limit, double casing_limit, const std::string& which) {
  if (limit > 0 && feedback.temperature_C > limit)
    return "at " + digits(feedback.temperature_C, 0) + " degC, beyond temperature." + which + " " + digits(limit, 0);
  if (casing_limit > 0 && feedback.casing_C > casing_limit)
    return "its casing at " + digits(feedback.casing_C, 0) + " degC, beyond temperature.casing_" + which + " " +
           digits(casing_limit, 0);
  return {};
}

bool has(const JointRecord& joint, ReplyFault fault) {
  return (joint.reply_faults & bit(fault)) != 0;
}

std::string silence(const JointRecord& joint, MonoTime now, Duration timeout) {
  const JointFeedback& feedback = joint.feedback;
  if (!feedback.received_at.is_set()) return "never answered";
  if (has(joint, ReplyFault::from_future)) return "its newest reply is stamped in the future";
  const Duration silent = now - feedback.received_at;
  return silent > timeout ? "silent for " + digits(silent.milliseconds(), 1) + " ms" : "";
}

// All at once: no drive's own fault. Empty: some were heard, or never answered.
std::string silence_of_all(const TickRecord& record, const config::RobotConfig& robot) {
  const std::size_t count = std::min<std::size_t>(record.header.joint_count, robot.joints.size());
  Duration longest;
  for (std::size_t j = 0; j < count; ++j) {
    const MonoTime heard = record.joints[j].feedback.received_at;
    if (!heard.is_set() || record.header.now - heard <= robot.feedback.timeout) return {};
    longest = std::max(longest, record.header.now - heard);
  }
  if (count < 2) return {};
  return "every joint at once, silent for " + digits(longest.milliseconds(), 1) +
         " ms: the drives' power or the buses (simulated: takt-plant) failed, or the computer stood still";
}

std::string implausible(const JointRecord& joint, const config::Joint& /*known*/) {
  if (has(joint, ReplyFault::jumped))
    return "its position jumped further than the joint can move: check its encoder, and home it before the reset";
  if (has(joint, ReplyFault::frozen))
    return "its position stands still while the joint moves: check its encoder before the reset";
  if (has(joint, ReplyFault::contradicts))
    return "its positions contradict the drive's own velocity: check encoder, sign and scale before the reset";
  return {};
}

// How far a joint was from its reference for longer than it may be.
std::string behind(const JointRecord& joint, const config::Joint& known, Duration timeout) {
  if (joint.behind == 0) return {};
  const double limit = known.limits.following_error;
  const std::string allowed =
      limit > 0
          ? "limits.following_error (" + with_unit(limit, 3, config::kJointPosition, known) + ")"
          : "90 % of limits.torque (" + with_unit(known.limits.torque, 1, config::kJointTorque, known) + ") allows";
  return with_unit(std::abs(joint.q_reference - joint.q_estimate), 3, config::kJointPosition, known) +
         " from its reference, more than " + allowed + ", for " + digits(timeout.milliseconds(), 0) +
         " ms: held, blocked, or too weak";
}

// "12 frames foreign since start"; nothing when there were none.
std::string counted(std::uint32_t frames, const std::string& what) {
  return frames == 0 ? "" : std::to_string(frames) + " frames " + what + " since start";
}

OfJoint replies_with(ReplyFault fault, const std::string& what) {
  return [fault, what](const JointRecord& joint, const config::Joint&) { return has(joint, fault) ? what : ""; };
}

}  // namespace

// That every cause which stops a robot has a place here or words of its own is a test's business (IncidentTest).
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wswitch-enum"
CauseFindings cause_findings(Cause cause, const TickRecord& record, const config::RobotConfig& robot) {
  switch (cause) {
    case Cause::drive_fault:
      return drive_errors(record, robot);
    case Cause::drive_disabled:
      return joints_where(record, robot, [](const JointRecord& joint, const config::Joint&) {
        return joint.feedback.drive_state == DriveState::disabled ? "left the enabled state by itself" : "";
      });
    case Cause::enable_timeout:
      return joints_where(record, robot, [](const JointRecord& joint, const config::Joint&) {
        return joint.feedback.drive_state == DriveState::enabled ? "" : "not enabled in time";
      });
    case Cause::feedback_lost:
      if (record.header.slept_ms != 0) return {};  // no one joint's fault: every joint is unheard
      return joints_where(record, robot, [&](const JointRecord& joint, const config::Joint&) {
        return silence(joint, record.header.now, robot.feedback.timeout);
      });
    case Cause::feedback_implausible:
      return joints_where(record, robot, implausible);
    case Cause::envelope_exceeded:
      return joints_where(record, robot, outside);
    case Cause::bus_off:
      return buses_off(record, robot);
    case Cause::bus_down:
      return buses_where(record, robot,
                         [](const BusHealth& bus) { return bus.state == BusState::down ? "down or gone" : ""; });
    case Cause::bus_error_passive:
      return buses_where(record, robot, [](const BusHealth& bus) {
        return bus.state == BusState::error_passive ? "error-passive" : "";
      });
    case Cause::bus_babble:
      return buses_where(record, robot, [](const BusHealth& bus) {
        return bus.flooded != 0 ? "more frames than our drives say" : "";
      });
    case Cause::transmit_queue_full:
      return buses_where(record, robot, [](const BusHealth& bus) { return counted(bus.tx_dropped, "not sent"); });
    case Cause::receive_overflow:
      return buses_where(record, robot,
                         [](const BusHealth& bus) { return counted(bus.rx_dropped, "lost on receive"); });
    case Cause::foreign_node:
      return buses_where(record, robot, [](const BusHealth& bus) { return counted(bus.foreign_frames, "foreign"); });
    case Cause::replies_lost:
      return joints_where(record, robot, replies_with(ReplyFault::lost, "replies lost"));
    case Cause::replies_repeated:
      return joints_where(record, robot, replies_with(ReplyFault::repeated, "more replies than commands"));
    case Cause::replies_delayed:
      return joints_where(record, robot, replies_with(ReplyFault::delayed, "replies late"));
    case Cause::internal_error:
      return joints_where(record, robot, refused_frame);
    case Cause::temperature_high:
      return joints_where(record, robot, [](const JointRecord& joint, const config::Joint& known) {
        const config::TemperatureLimits limits = known.limits.temperature.value_or(config::TemperatureLimits{});
        return hot(joint.feedback, limits.warning, limits.casing_warning, "warning");
      });
    case Cause::overtemperature:
      return joints_where(record, robot, [](const JointRecord& joint, const config::Joint& known) {
        const config::TemperatureLimits limits = known.limits.temperature.value_or(config::TemperatureLimits{});
        return hot(joint.feedback, limits.stop, limits.casing_stop, "stop");
      });
    case Cause::following_error:
    case Cause::following_lost:
      return joints_where(record, robot, [&](const JointRecord& joint, const config::Joint& known) {
        return behind(joint, known, robot.feedback.following_timeout);
      });
    default:
      return {};  // about the robot as a whole
  }
}
#pragma GCC diagnostic pop

std::string place_text(const CauseFinding& finding, const config::RobotConfig& robot) {
  switch (finding.place) {
    case CausePlace::joint:
      return "joint " + robot.joints[finding.index].name;
    case CausePlace::bus:
      return "bus " + robot.buses[finding.index].name;
  }
  return {};
}

std::string cause_detail(Cause cause, const TickRecord& record, const config::RobotConfig& robot) {
  if (cause == Cause::feedback_lost && record.header.slept_ms != 0)
    return "the computer was suspended for " + digits(record.header.slept_ms / 1000.0, 1) + " s";
  if (cause == Cause::feedback_lost)
    if (std::string all = silence_of_all(record, robot); !all.empty()) return all;
  std::string text;
  for (const CauseFinding& finding : cause_findings(cause, record, robot))
    text += (text.empty() ? "" : "; ") + place_text(finding, robot) + ": " + finding.what;
  return text;
}

}  // namespace takt::drivers
