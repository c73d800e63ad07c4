// SPDX-License-Identifier: Apache-2.0
// The wake-ups that were measured, which have the last word, and what took the processor away meanwhile.
#include <fmt/format.h>

#include "systemd/doctor/judge.hpp"

namespace takt::doctor {
namespace {

// Only Intel's processors have MSR 0x34.
Finding smis(const Snapshot& machine, const WakeupLatency& latency) {
  const std::string where =
      fmt::format("MSR 0x34 in /dev/cpu/{}/msr, over {} wake-ups", latency.cpu.value_or(0), latency.samples);
  if (const auto count = smis_counted(machine)) {
    if (*count == 0) return fine("SMIs", "none during the measurement", where);
    return bad(Verdict::warn, "SMIs", fmt::format("{} during the measurement: each stops every core, unseen", *count),
               where,
               "in the firmware's setup turn off USB legacy support and power management; a newer firmware; "
               "hwlatdetect (rt-tests) says how long they take");
  }
  if (machine.hypervisor) return fine("SMIs", "not counted: a virtual machine does not see the firmware's", where);
  if (machine.processor_vendor != "GenuineIntel" || latency.interference.smi_counter == SmiCounter::no_register)
    return fine("SMIs", "not counted: this processor has no count of them", where);
  return bad(Verdict::warn, "SMIs",
             fmt::format("not counted: the count could not be read{}",
                         latency.interference.smi_counter == SmiCounter::refused ? " by this user" : ""),
             where, "as root: modprobe msr, then takt doctor again");
}

Finding stolen(const WakeupLatency& latency) {
  const std::string where = fmt::format("/proc/stat, over {} wake-ups", latency.samples);
  const std::string from = latency.cpu ? fmt::format("core {}", *latency.cpu) : "all cores";
  const auto stolen_ms = latency.interference.stolen_ms;
  if (!stolen_ms) return fine("stolen time", "not counted", where);
  const std::string found = fmt::format("{} ms of {} during the measurement", *stolen_ms, from);
  if (*stolen_ms == 0) return fine("stolen time", found, where);
  return bad(Verdict::warn, "stolen time", found, where, "a hypervisor gave it to others: run on the metal");
}

constexpr double kLeastBusy = 0.5;  // of the other cores, for a measurement to count as one under load

Finding load(const WakeupLatency& latency) {
  const std::string where = fmt::format("/proc/stat, over {} wake-ups", latency.samples);
  const auto& others = latency.interference.others;
  if (!others || others->all_ticks <= 0) return fine("load", "not counted", where);
  const double busy = static_cast<double>(others->busy_ticks) / static_cast<double>(others->all_ticks);
  const std::string found = fmt::format("the other cores were busy for {:.0f} % of the measurement{}", 100 * busy,
                                        latency.own_load ? ", by the doctor's own load" : "");
  if (busy >= kLeastBusy) return fine("load", found, where);
  return bad(Verdict::warn, "load", found + ": what follows was measured on an idle machine", where,
             "takt doctor --load, or run it while the robot's programs run");
}

// Late wake-ups from sleep states that the executive would forbid say little of the executive.
std::string first_hold_awake(const WakeupLatency& latency) {
  if (latency.held_awake) return {};
  return "measure where /dev/cpu_dma_latency can be opened (sudo), as the executive does; ";
}

Finding wakeups(const WakeupLatency& latency, const config::RobotConfig* robot) {
  const std::int64_t period_ns = robot == nullptr ? 1'000'000 : robot->control.period.ns;
  const std::string where = fmt::format("{} wake-ups measured here", latency.samples);
  const std::string rarest =
      latency.p99999_ns ? fmt::format("{} us at p99.999 ({} later), ", *latency.p99999_ns / 1000, latency.beyond_p99999)
                        : std::string();
  const std::string found = fmt::format("late by {} us at p99, {}{} us at worst{}{}", latency.p99_ns / 1000, rarest,
                                        latency.max_ns / 1000, latency.real_time ? "" : ", without real-time priority",
                                        latency.held_awake ? "" : ", with sleep states allowed");
  if (latency.max_ns > period_ns / 2)
    return bad(Verdict::fail, "wake-ups", found, where,
               first_hold_awake(latency) +
                   "correct the lines above first; then look for what the firmware does with hwlatdetect (rt-tests)");
  if (latency.max_ns > period_ns / 10 || !latency.real_time)
    return bad(
        Verdict::warn, "wake-ups", found, where,
        first_hold_awake(latency) + "a tenth of the period is a good bound: isolate the core, measure under load");
  return fine("wake-ups", found, where);
}

}  // namespace

std::optional<std::uint32_t> smis_counted(const Snapshot& machine) {
  if (!machine.wakeup || machine.hypervisor || machine.wakeup->interference.smi_counter != SmiCounter::read)
    return std::nullopt;
  return machine.wakeup->interference.smis;
}

void judge_measurement(const Case& of, Findings& into) {
  if (!of.machine.wakeup) return;
  into.push_back(smis(of.machine, *of.machine.wakeup));
  into.push_back(stolen(*of.machine.wakeup));
  into.push_back(load(*of.machine.wakeup));
  into.push_back(wakeups(*of.machine.wakeup, of.robot));
}

}  // namespace takt::doctor
