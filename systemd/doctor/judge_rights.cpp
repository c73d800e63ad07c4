// SPDX-License-Identifier: Apache-2.0
// What the executive may ask of the kernel: priority, locked memory, and how long it may run at a stretch.
#include <fmt/format.h>

#include <algorithm>

#include "systemd/doctor/judge.hpp"

namespace takt::doctor {
namespace {

// What the executive asks for before it believes that its memory stays locked.
constexpr std::uint64_t kLockedMemoryNeeded = std::uint64_t{256} << 20U;

std::uint64_t priority_of(const Case& of) {
  return of.robot == nullptr ? 80 : static_cast<std::uint64_t>(of.robot->control.priority);
}

Finding granted_or(const Snapshot& machine, bool granted, const char* check, const std::string& found,
                   const std::string& where, const std::string& cure) {
  if (granted) return fine(check, found, where);
  if (machine.units_installed)
    return bad(Verdict::warn, check, found + " for this user; takt-executive.service grants it to itself", where, cure);
  return bad(Verdict::fail, check, found, where, cure);
}

Finding rtprio(const Case& of) {
  const Snapshot& machine = of.machine;
  const std::string found =
      machine.may_set_priority ? std::string("CAP_SYS_NICE") : fmt::format("limit {}", machine.rtprio_limit);
  const bool granted = machine.may_set_priority || machine.rtprio_limit >= priority_of(of);
  return granted_or(machine, granted, "rtprio", found, "RLIMIT_RTPRIO",
                    fmt::format("`USER - rtprio {}` in /etc/security/limits.d/takt.conf, then log in again",
                                std::max<std::uint64_t>(priority_of(of), 99)));
}

Finding memlock(const Snapshot& machine) {
  const std::string found = machine.may_lock_memory ? std::string("CAP_IPC_LOCK")
                                                    : fmt::format("limit {} MiB", machine.memlock_limit_bytes >> 20U);
  const bool granted = machine.may_lock_memory || machine.memlock_limit_bytes >= kLockedMemoryNeeded;
  return granted_or(machine, granted, "memlock", found, "RLIMIT_MEMLOCK",
                    "`USER - memlock unlimited` in /etc/security/limits.d/takt.conf, then log in again");
}

// A loop that sleeps every period never meets the limit; one that spins for most of it does.
Finding throttling(const Case& of) {
  const std::string where = "/proc/sys/kernel/sched_rt_runtime_us";
  const auto runtime = of.machine.rt_runtime_us, period = of.machine.rt_period_us;
  if (!runtime || !period) return fine("rt throttling", "not known to this kernel", where);
  if (*runtime < 0 || *runtime >= *period) return fine("rt throttling", "off", where);
  const double allowed = static_cast<double>(*runtime) / static_cast<double>(*period);
  const std::string found = fmt::format("real-time threads may run {:.0f} % of the time", 100 * allowed);
  const bool spins = of.robot != nullptr && of.robot->control.wake == config::WakeMode::hybrid;
  const double share = spins ? of.robot->control.spin.seconds() / of.robot->control.period.seconds() : 0;
  if (share < 0.8 * allowed) return fine("rt throttling", found, where);
  return bad(Verdict::fail, "rt throttling", fmt::format("{}, and control.spin takes {:.0f} %", found, 100 * share),
             where, "shorten control.spin, or sysctl kernel.sched_rt_runtime_us=-1");
}

}  // namespace

void judge_rights(const Case& of, Findings& into) {
  into.push_back(rtprio(of));
  into.push_back(memlock(of.machine));
  into.push_back(throttling(of));
}

}  // namespace takt::doctor
