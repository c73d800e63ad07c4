// SPDX-License-Identifier: Apache-2.0
#include "monitor/dds/wire.hpp"

#include <string_view>

#include "executive/contract/tick_facts.hpp"

namespace takt::monitor::dds {
namespace {

// DDS reads what it is asked to write; its C structures cannot say so.
template <class T>
T* borrowed(const T* value) {
  return const_cast<T*>(value);
}

// Precondition: zero-terminated, as strings and our constants are.
char* borrowed(std::string_view text) {
  return borrowed(text.data());
}

template <class Sequence, class Item>
void refer(Sequence& sequence, const std::vector<Item>& items) {
  sequence._length = sequence._maximum = static_cast<std::uint32_t>(items.size());
  sequence._buffer = borrowed(items.data());
}

// Floors, so that instants before 1970 are right too.
builtin_interfaces_msg_dds__Time_ time_of(std::int64_t unix_ns) {
  constexpr std::int64_t second = 1'000'000'000;
  const std::int64_t whole = unix_ns / second - (unix_ns % second < 0 ? 1 : 0);
  return {static_cast<std::int32_t>(whole), static_cast<std::uint32_t>(unix_ns - whole * second)};
}

}  // namespace

void lend(const JointStates& message, const config::RobotConfig& robot, LentJointStates& out) {
  for (const config::Joint& joint : robot.joints) out.names.push_back(borrowed(joint.name));
  out.wire.header.stamp = time_of(message.unix_ns);
  out.wire.header.frame_id = borrowed("");
  refer(out.wire.name, out.names);
  refer(out.wire.position, message.position);
  refer(out.wire.velocity, message.velocity);
  refer(out.wire.effort, message.effort);
}

void lend(const Diagnostics& message, const config::RobotConfig& robot, LentDiagnostics& out) {
  out.wire.header.stamp = time_of(message.unix_ns);
  out.wire.header.frame_id = borrowed("");
  out.values.reserve(message.parts.size());
  for (const Diagnostic& part : message.parts) {
    auto& values = out.values.emplace_back();
    for (const auto& [key, value] : part.values) values.push_back({borrowed(key), borrowed(value)});
    auto& wire = out.parts.emplace_back();
    wire.level = static_cast<std::uint8_t>(part.level);
    wire.name = borrowed(part.name);
    wire.message = borrowed(part.message);
    wire.hardware_id = borrowed(robot.robot);
    refer(wire.values, values);
  }
  refer(out.wire.status, out.parts);
}

void lend(const Status& message, const Losses& losses, const RequestAnswer& answer, const config::RobotConfig& robot,
          const std::string& machine, LentStatus& out) {
  const TickRecordHeader& tick = message.tick;
  for (const std::string_view cause : names_of_active_causes(tick)) out.causes.push_back(borrowed(cause));
  const auto lost = [&](Channel channel) { return losses[static_cast<std::size_t>(channel)]; };
  auto& wire = out.wire;
  wire.stamp = time_of(message.unix_ns);
  wire.robot = borrowed(robot.robot);
  wire.machine = borrowed(machine);
  wire.running = message.running;
  wire.tick = tick.tick;
  wire.mode = borrowed(name(tick.mode));
  wire.cause = borrowed(name(message.cause));
  wire.detail = borrowed(message.detail);
  wire.freshness = borrowed(name(tick.seats[Seat::policy].freshness));
  wire.age_ns = tick.age.total().ns;
  wire.window_misses = tick.window_misses;
  wire.window_ticks = tick.window_ticks;
  wire.skipped_periods = tick.skipped_periods;
  wire.overruns = message.overruns;
  wire.refused_commands = tick.refused_commands;
  wire.integration_errors = tick.integration_errors;
  wire.command_sequence = tick.seats[Seat::policy].command_sequence;
  wire.observation_answered = tick.seats[Seat::policy].observation_answered;
  wire.drives_enabled = tick.drives_enabled != 0;
  refer(wire.causes_active, out.causes);
  wire.lost_joint_states = lost(Channel::joint_states);
  wire.lost_diagnostics = lost(Channel::diagnostics);
  wire.lost_status = lost(Channel::status);
  wire.lost_command_ages = lost(Channel::command_age);
  wire.request_id = answer.id;
  wire.request_verb = borrowed(answer.verb);
  wire.request_done = answer.done;
  wire.request_answer = borrowed(answer.sentences);
}

takt_msgs_msg_dds__CommandAge_ lend(const CommandAge& message, const config::RobotConfig& robot) {
  return {.stamp = time_of(message.unix_ns),
          .robot = borrowed(robot.robot),
          .tick = message.tick,
          .command_sequence = message.sequence,
          .observation_id = message.observation,
          .sense_ns = message.age.sense.ns,
          .queue_ns = message.age.queue.ns,
          .infer_ns = message.age.infer.ns,
          .publish_ns = message.age.publish.ns,
          .hold_ns = message.age.hold.ns,
          .total_ns = message.age.total().ns};
}

}  // namespace takt::monitor::dds
