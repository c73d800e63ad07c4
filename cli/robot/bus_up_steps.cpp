// SPDX-License-Identifier: Apache-2.0
#include "cli/robot/bus_up_steps.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace takt::cli {
namespace {

using Words = std::vector<std::string>;

// A bus of 1 kHz that is down should not hide behind a long queue: frames older than a few periods are worthless. The
// kernel's default of 10 is less than what twelve drives get in one period.
constexpr std::size_t kFewestQueued = 32, kQueuedPerDrive = 8;
// After bus-off the controller rejoins by itself; the executive latches the fault and disables the drives meanwhile.
constexpr int kRestart_ms = 100;

// What the robot file leaves to the kernel is not mentioned. `phase`: "d" for the data phase.
void add_timing(const std::string& phase, double sample_point, std::uint32_t sjw, Words& words) {
  if (sample_point > 0) words.insert(words.end(), {phase + "sample-point", fmt::format("{:.3f}", sample_point)});
  if (sjw > 0) words.insert(words.end(), {phase + "sjw", std::to_string(sjw)});
}

Words timing_command(const config::Bus& bus) {
  Words type{"ip", "link", "set", bus.interface, "type", "can", "bitrate", std::to_string(bus.bitrate)};
  add_timing("", bus.sample_point, bus.sjw, type);
  if (bus.fd) {
    type.insert(type.end(), {"dbitrate", std::to_string(bus.data_bitrate)});
    add_timing("d", bus.data_sample_point, bus.data_sjw, type);
    type.insert(type.end(), {"fd", "on"});
  }
  return type;
}

struct KernelAnswer {
  std::string_view says, cure;
};
// As iproute2 and the kernel's extended acknowledgements word them.
constexpr KernelAnswer kKernelAnswers[] = {
    {"Operation not permitted", "it needs root or CAP_NET_ADMIN"},
    {"Cannot find device", "the adapter is gone: plug it in again"},
    {"No such device", "the adapter is gone: plug it in again"},
    {"Device or resource busy", "something else brought it up meanwhile: stop that (NetworkManager, a udev rule)"},
    {"is unknown", "this iproute2 is too old for it: apt-get install iproute2"},
    {"Garbage instead of arguments", "this iproute2 is too old for it: apt-get install iproute2"},
    {"CAN FD", "its adapter or driver has no CAN FD: write `fd: false`, or take another adapter"},
    {"bitrate", "its controller cannot make this bit timing: `ip -details link show` tells its clock and limits"},
    {"bit-timing", "its controller cannot make this bit timing: `ip -details link show` tells its clock and limits"},
    {"out of range", "its controller cannot make this bit timing: `ip -details link show` tells its clock and limits"},
    {"Invalid argument",
     "its controller cannot make this bit timing: `ip -details link show` tells its clock and limits"},
    {"Network is down", "the kernel took it down again: see `dmesg`"},
    {"Input/output error", "the adapter does not answer: plug it in again"},
    {"Connection timed out", "the adapter does not answer: plug it in again"},
};

std::unexpected<Refusal> up_failed(std::string sentence) {
  return std::unexpected(Refusal{kExitFailed, std::move(sentence)});
}

// What was set, held against the robot file: a kernel that takes a command need not do as it says.
std::string wrong_after(const UpStep& step, const config::Bus& bus, const UpTools& tools) {
  switch (step.sets) {
    case UpStep::Sets::nothing:
      return {};
    case UpStep::Sets::timing:
      return drivers::wrong_timing(bus, tools.look());
    case UpStep::Sets::restart:
      return tools.look().restart_ms == 0 ? "no restart after bus-off" : "";
  }
  return {};
}

std::string restart_note(const config::RobotConfig& robot, const config::Bus& bus) {
  return fmt::format(
      "{}: its driver does not restart the controller after bus-off; then this does: takt bus up --robot {} "
      "--interface "
      "{}",
      bus.interface, robot.file, bus.interface);
}

}  // namespace

LinkKind kind_of(const drivers::CanLink& link) {
  if (!link.exists || link.kind == "can") return LinkKind::controller;
  return link.kind == "vcan" || link.kind == "vxcan" ? LinkKind::vcan : LinkKind::serial;
}

std::expected<std::vector<std::string>, Refusal> bring_up(const config::RobotConfig& robot, std::size_t index,
                                                          const UpTools& tools) {
  const config::Bus& bus = robot.buses[index];
  const LinkKind kind = kind_of(tools.look());
  std::vector<std::string> told;
  for (const UpStep& step : up_steps(robot, index, kind)) {
    const ToolResult result = tools.run(step.command);
    if (result.exit_code == kToolMissing)
      return std::unexpected(Refusal{kExitUnavailable, "`ip` is not installed: apt-get install iproute2"});
    const bool is_restart = step.sets == UpStep::Sets::restart;
    if (result.exit_code != 0 && !is_restart) return up_failed(why_refused(step.command, result.output));
    const std::string wrong = result.exit_code == 0 ? wrong_after(step, bus, tools) : std::string();
    if (!wrong.empty() && !is_restart)
      return up_failed(fmt::format("{}: `{}` was taken, and it has {}", bus.interface, line_of(step.command), wrong));
    if (is_restart && (result.exit_code != 0 || !wrong.empty())) told.push_back(restart_note(robot, bus));
  }
  if (!tools.look().up) return up_failed(bus.interface + " did not stay up: see `dmesg`");
  told.push_back(fmt::format("{} is up for bus {}", bus.interface, bus.name));
  if (kind == LinkKind::serial)
    told.push_back(
        fmt::format("{}: the kernel knows no bit rate of it. Was slcand started with the option for {} bit/s?",
                    bus.interface, bus.bitrate));
  return told;
}

std::vector<UpStep> up_steps(const config::RobotConfig& robot, std::size_t index, LinkKind kind) {
  const config::Bus& bus = robot.buses[index];
  std::size_t drives = 0;
  for (const config::Joint& joint : robot.joints) drives += joint.bus == index ? 1 : 0;
  const std::string queue = std::to_string(std::max(kFewestQueued, kQueuedPerDrive * drives));
  std::vector<UpStep> steps{{{"ip", "link", "set", bus.interface, "down"}}};
  if (kind == LinkKind::controller) {
    steps.push_back({timing_command(bus), UpStep::Sets::timing});
    steps.push_back({{"ip", "link", "set", bus.interface, "type", "can", "restart-ms", std::to_string(kRestart_ms)},
                     UpStep::Sets::restart});
  } else if (kind == LinkKind::vcan && bus.fd) {
    steps.push_back({{"ip", "link", "set", bus.interface, "mtu", "72"}});
  }
  steps.push_back({{"ip", "link", "set", bus.interface, "txqueuelen", queue, "up"}});
  return steps;
}

std::string why_refused(const Words& command, std::string_view said) {
  const std::string_view line = said.substr(0, said.find('\n'));
  const bool is_fd = std::ranges::find(command, "fd") != command.end();
  const auto known = std::ranges::find_if(
      kKernelAnswers, [&](const KernelAnswer& answer) { return said.find(answer.says) != std::string_view::npos; });
  std::string cure;
  if (is_fd && said.find("Operation not supported") != std::string_view::npos)
    cure = "its adapter or driver has no CAN FD: write `fd: false`, or take another adapter";
  else if (said.find("Operation not supported") != std::string_view::npos)
    cure = "its driver does not do that: an adapter on a serial line gets its bit rate from slcand";
  else if (known != std::end(kKernelAnswers))
    cure = known->cure;
  return fmt::format("`{}` failed: {}{}{}", line_of(command), line, cure.empty() ? "" : "; ", cure);
}

std::string line_of(const Words& command) {
  return fmt::format("{}", fmt::join(command, " "));
}

}  // namespace takt::cli
