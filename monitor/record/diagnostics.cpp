// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/diagnostics.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <tuple>
#include <utility>

#include "config/joint_units.hpp"
#include "drivers/protocol/cause_detail.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "executive/contract/feedback_names.hpp"
#include "executive/contract/tick_facts.hpp"

namespace takt::monitor {
namespace {

Level bus_level(BusState state) {
  switch (state) {
    case BusState::up:
      return Level::ok;
    case BusState::error_passive:
      return Level::warn;
    case BusState::bus_off:
    case BusState::down:
      return Level::error;
  }
  return Level::error;
}

// "window misses": "4"; a unit follows its number.
struct DiagnosticFacts {
  void operator()(std::string name, const auto& value) {
    std::ranges::replace(name, '_', ' ');
    values.emplace_back(std::move(name), text(value));
  }
  static std::string text(const auto& value) { return fmt::format("{}", value); }
  static std::string text(PolicyHash policy) { return fmt::format("{:016x}", policy.value); }
  static std::string text(const std::vector<std::string_view>& names) {
    return fmt::format("{}", fmt::join(names, ", "));
  }
  static std::string text(std::optional<Duration> age) {
    return age ? fmt::format("{:.3f} ms", age->milliseconds()) : "none";
  }
  std::vector<std::pair<std::string, std::string>> values;
};

Diagnostic diagnose_executive(const RobotStatus& status, const config::RobotConfig& robot) {
  const TickRecordHeader& header = status.tick;
  std::string message(takt::name(header.mode));
  if (status.cause != Cause::none) message += fmt::format(": {}", takt::name(status.cause));
  if (!status.detail.empty()) message += fmt::format(": {}", status.detail);
  if (!status.incident.empty()) message = status.incident;
  DiagnosticFacts facts;
  tell_facts(header, facts);
  facts("cause", takt::name(status.cause));
  facts("overruns_seen", status.overruns);
  return {level_of(header.mode), robot.robot + ": executive", message, std::move(facts.values)};
}

// The worst thing to say about a drive, and how bad it is.
std::pair<Level, std::string> judge_drive(const JointFeedback& feedback, const TickRecordHeader& header,
                                          const config::Joint& joint, Duration timeout) {
  if (!feedback.received_at.is_set()) return {Level::stale, "never answered"};
  const Duration silent = header.now - feedback.received_at;
  if (silent > timeout) return {Level::stale, fmt::format("silent for {:.1f} ms", silent.milliseconds())};
  if (feedback.error_code != 0) return {Level::error, drivers::error_name(joint.drive, feedback.error_code)};
  switch (feedback.drive_state) {
    case DriveState::fault:
      return {Level::error, "the drive reports a fault"};
    case DriveState::unknown:
      return {Level::warn, "state unknown"};
    case DriveState::enabled:
    case DriveState::disabled:
      return {Level::ok, std::string(name(feedback.drive_state))};
  }
  return {Level::error, "state invalid"};
}

Diagnostic diagnose_joint(const TickRecord& record, std::size_t index, const config::RobotConfig& robot) {
  const JointFeedback& feedback = record.joints[index].feedback;
  const config::Joint& joint = robot.joints[index];
  auto [level, message] = judge_drive(feedback, record.header, joint, robot.feedback.timeout);
  for (const Cause told : {Cause::temperature_high, Cause::following_error})
    for (const drivers::CauseFinding& found : drivers::cause_findings(told, record, robot))
      if (level == Level::ok && found.index == index) std::tie(level, message) = std::pair(Level::warn, found.what);
  return {level,
          fmt::format("{}: joint {}", robot.robot, joint.name),
          std::move(message),
          {{"drive state", std::string(name(feedback.drive_state))},
           {"error code", fmt::format("{:#x}", feedback.error_code)},
           {"temperature", fmt::format("{:.0f} degC", feedback.temperature_C)},
           {"position", fmt::format("{:.4f} {}", feedback.q, config::kJointPosition.unit(joint.kind))},
           {"bus", robot.buses[joint.bus].name}}};
}

Diagnostic diagnose_bus(const BusHealth& health, const config::Bus& bus, const config::RobotConfig& robot) {
  return {bus_level(health.state),
          fmt::format("{}: bus {}", robot.robot, bus.name),
          std::string(name(health.state)),
          {{"frames not sent", fmt::format("{}", health.tx_dropped)},
           {"frames lost on receive", fmt::format("{}", health.rx_dropped)},
           {"foreign frames", fmt::format("{}", health.foreign_frames)}}};
}

}  // namespace

Level level_of(Mode mode) {
  switch (mode) {
    case Mode::standby:
    case Mode::arming:
    case Mode::tracking:
      return Level::ok;
    case Mode::degraded:
    case Mode::damped_stop:
      return Level::warn;
    case Mode::fault_latched:
      return Level::error;
  }
  return Level::error;
}

std::vector<Diagnostic> diagnose(const TickRecord& record, const RobotStatus& status,
                                 const config::RobotConfig& robot) {
  const TickRecordHeader& header = record.header;
  std::vector<Diagnostic> parts{diagnose_executive(status, robot)};
  const std::size_t joints = std::min<std::size_t>(header.joint_count, robot.joints.size());
  for (std::size_t joint = 0; joint < joints; ++joint) parts.push_back(diagnose_joint(record, joint, robot));
  const std::size_t buses = std::min<std::size_t>(header.bus_count, robot.buses.size());
  for (std::size_t bus = 0; bus < buses; ++bus)
    parts.push_back(diagnose_bus(header.buses[bus], robot.buses[bus], robot));
  return parts;
}

std::vector<Diagnostic> diagnose_absence(const config::RobotConfig& robot) {
  return {{Level::stale, robot.robot + ": executive", "no executive answers the monitor", {}}};
}

std::optional<std::vector<Diagnostic>> Diagnoser::tick(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  const bool changed = header.mode != header.previous_mode;
  const auto incident = incidents_.tick(record);
  if (changed) {
    status_.cause = header.cause;
    status_.detail = incident ? incident->detail : drivers::cause_detail(header.cause, record, robot_);
    status_.incident = incident ? incident->sentence : "";
  }
  if (header.overrun_cause != OverrunCause::none) ++status_.overruns;
  status_.tick = header;
  const bool is_due = rate_.is_due(header.now);
  if (!changed && !is_due) return std::nullopt;
  return diagnose(record, status_, robot_);
}

}  // namespace takt::monitor
