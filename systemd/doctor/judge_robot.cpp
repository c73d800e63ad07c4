// SPDX-License-Identifier: Apache-2.0
// What the robot's file asks of this machine: its CAN interfaces, room for its runs; and whether the machine restarts
// itself when all else fails.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "systemd/doctor/judge.hpp"

namespace takt::doctor {
namespace {

constexpr std::uint64_t kGiB = std::uint64_t{1} << 30U;
constexpr double kLeastHours = 1, kGoodHours = 24;
constexpr std::int64_t kShortestQueue = 32;  // frames
constexpr std::uint32_t kErrorWarning = 96;  // ISO 11898-1: a heavily disturbed bus

Finding missing(const config::Bus& bus, const std::string& check, const std::string& where) {
  switch (bus.when_missing) {
    case config::WhenBusMissing::refuse:
      return bad(Verdict::fail, check, "this machine has no such interface", where,
                 "plug the adapter in; `dmesg | grep -i can` says whether its driver came");
    case config::WhenBusMissing::loopback:
      return bad(Verdict::warn, check, "this machine has no such interface: the robot is a simulation", where,
                 "a real robot: plug the adapter in, and write `when_missing: refuse`");
  }
  return fine(check, "not needed", where);
}

// What is wrong with how an interface is set; empty: nothing.
std::string wrong_setting(const config::Bus& bus, const drivers::CanLink& can) {
  if (!can.up) return "down";
  if (const std::string wrong = drivers::wrong_timing(bus, can); !wrong.empty()) return wrong;
  return can.controller_state == "BUS-OFF" ? "bus-off" : "";
}

// What the controller counted, where it says that the wiring or a node's timing is not right.
std::string troubled_past(const drivers::CanLink& can) {
  const std::uint32_t transmit = can.transmit_errors.value_or(0), receive = can.receive_errors.value_or(0);
  if (can.went_off == 0 && can.went_passive == 0 && std::max(transmit, receive) < kErrorWarning) return {};
  std::string now;
  if (can.transmit_errors) now = fmt::format("error counters now {} transmit, {} receive; ", transmit, receive);
  return fmt::format("{}{} bus errors, {} times error-passive, {} times bus-off, {} restarts", now, can.bus_errors,
                     can.went_passive, can.went_off, can.restarts);
}

Finding can_interface(const config::Bus& bus, const drivers::CanLink& can) {
  const std::string check = "can " + bus.interface, where = "ip -details link show " + bus.interface;
  if (!can.exists) return missing(bus, check, where);
  const std::string up =
      fmt::format("takt bus up --robot FILE --interface {} (or enable takt-can@{})", bus.interface, bus.interface);
  if (const std::string wrong = wrong_setting(bus, can); !wrong.empty())
    return bad(Verdict::fail, check, wrong, where, up);
  if (can.controller_state == "ERROR-PASSIVE" || can.controller_state == "ERROR-WARNING")
    return bad(Verdict::warn, check, "up, but " + can.controller_state, where,
               "check termination (60 ohm across the bus), wiring and the drives' bit rate");
  if (const std::string errors = troubled_past(can); !errors.empty())
    return bad(Verdict::warn, check, errors, "ip -details -statistics link show " + bus.interface,
               "look at termination, cable and every node's bit timing; the counts begin anew with the driver");
  if (can.queue_length < kShortestQueue)
    return bad(Verdict::warn, check, fmt::format("up, its queue holds {} frames", can.queue_length), where, up);
  return fine(check,
              can.is_virtual ? "up, virtual" : fmt::format("up, {} bit/s, {}", can.bitrate, can.controller_state),
              where);
}

Finding disk(const Snapshot& machine) {
  const double hours = machine.runs_hours_left;
  const std::string found =
      fmt::format("{:.1f} GiB free: {}", static_cast<double>(machine.runs_free_bytes) / static_cast<double>(kGiB),
                  std::isinf(hours) ? "record.keep makes room" : fmt::format("{:.1f} hours of recording", hours));
  if (hours < kLeastHours)
    return bad(Verdict::fail, "disk", found, machine.runs_folder,
               "remove old runs (takt runs list), or name another record.directory");
  if (hours < kGoodHours)
    return bad(Verdict::warn, "disk", found, machine.runs_folder,
               "make room, or let record.keep delete old runs (docs/run-folder.md)");
  return fine("disk", found, machine.runs_folder);
}

Finding watchdog(const Snapshot& machine) {
  const std::string where = "/sys/class/watchdog/watchdog0, /etc/systemd/system.conf";
  if (machine.watchdog.empty())
    return bad(Verdict::warn, "watchdog", "no hardware watchdog", where,
               "load its driver (iTCO_wdt, i6300esb, sp5100_tco)");
  if (machine.systemd_watchdog.empty() || machine.systemd_watchdog == "off" || machine.systemd_watchdog == "0")
    return bad(Verdict::warn, "watchdog", machine.watchdog + ", and nothing feeds it", where,
               "RuntimeWatchdogSec=10s in /etc/systemd/system.conf: a machine that hangs restarts itself");
  return fine("watchdog", fmt::format("{}, fed every {}", machine.watchdog, machine.systemd_watchdog), where);
}

Finding waived(const config::WatchdogWaiver& waiver) {
  return bad(Verdict::warn, "drive " + waiver.joint, "has no command timeout: " + waiver.reason,
             "joints[].drive.watchdog_waiver of the robot file",
             "set the time-out in the drive; where the drive tells it, drop the waiver");
}

}  // namespace

void judge_robot(const Case& of, Findings& into) {
  if (of.robot != nullptr) {
    for (std::size_t bus = 0; bus < of.robot->buses.size() && bus < of.machine.can.size(); ++bus)
      into.push_back(can_interface(of.robot->buses[bus], of.machine.can[bus]));
    for (const config::WatchdogWaiver& waiver : config::watchdog_waivers(*of.robot)) into.push_back(waived(waiver));
    into.push_back(disk(of.machine));
  }
  into.push_back(watchdog(of.machine));
}

}  // namespace takt::doctor
