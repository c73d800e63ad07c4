// SPDX-License-Identifier: Apache-2.0
// What else may take the control core or slow it down: its hardware threads, others' real-time threads, kernel work,
// memory that moves. Source of the settings: Documentation/admin-guide/{cpu-isolation,mm/transhuge,sysctl/kernel},
// Documentation/core-api/workqueue, and tuned's profile `realtime`.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "systemd/doctor/judge.hpp"

namespace takt::doctor {
namespace {

Finding hardware_threads(const Case& of, int cpu) {
  const std::string where = fmt::format("/sys/devices/system/cpu/cpu{}/topology/thread_siblings_list", cpu);
  std::vector<int> busy;
  for (const int sibling : of.machine.neighbourhood.hardware_threads)
    if (sibling != cpu && contains(of.machine.cpus, sibling) && !contains(of.machine.isolated, sibling))
      busy.push_back(sibling);
  if (busy.empty()) return fine("hw threads", fmt::format("core {} shares its units with no other", cpu), where);
  return bad(
      Verdict::warn, "hw threads",
      fmt::format("core {} shares caches and arithmetic with core {}, which runs whatever there is", cpu,
                  fmt::join(busy, ", ")),
      where,
      fmt::format("echo 0 > /sys/devices/system/cpu/cpu{}/online at start-up, or isolate both, or boot with nosmt",
                  busy.front()));
}

// The kernel's own that no user can lower: they run for microseconds, when processors come, go or are balanced.
bool is_of_the_kernel(const RealTimeThread& thread) {
  constexpr std::string_view kOwn[] = {"migration/", "stop/", "idle_inject/", "watchdog/", "cpuhp/"};
  return std::ranges::any_of(kOwn, [&](std::string_view name) { return thread.name.starts_with(name); });
}

Finding real_time_threads(const Case& of, int cpu) {
  const std::string where = "/proc/*/task/*/stat";
  const int ours = of.robot->control.priority;
  std::vector<std::string> before_us;
  for (const RealTimeThread& thread : of.machine.neighbourhood.real_time_threads)
    if (thread.priority >= ours && contains(thread.cpus, cpu) && !is_of_the_kernel(thread) &&
        !thread.name.starts_with("takt-"))
      before_us.push_back(fmt::format("{} ({})", thread.name, thread.priority));
  if (before_us.empty())
    return fine("rt threads", fmt::format("none comes before the loop's priority {}", ours), where);
  const std::size_t count = before_us.size();
  if (count > 3) before_us.resize(3);
  return bad(Verdict::warn, "rt threads",
             fmt::format("before the loop's priority {} on core {} come {}{}", ours, cpu, fmt::join(before_us, ", "),
                         count > 3 ? ", ..." : ""),
             where, "raise control.priority, lower theirs (chrt -f -p), or keep them off the core (taskset -p)");
}

Finding irqbalance(const Case& of) {
  const std::string where = "/proc/*/comm";
  if (!of.machine.neighbourhood.irqbalance_runs) return fine("irqbalance", "does not run", where);
  return bad(Verdict::warn, "irqbalance", "runs, and may move interrupts to the loop's core", where,
             "systemctl disable --now irqbalance, or IRQBALANCE_BANNED_CPULIST in /etc/default/irqbalance");
}

Finding work_queues(const Case& of, int cpu) {
  const std::string where = "/sys/devices/virtual/workqueue/cpumask";
  if (!contains(of.machine.neighbourhood.work_queue_cpus, cpu))
    return fine("work queues", fmt::format("unbound kernel work stays off core {}", cpu), where);
  return bad(Verdict::warn, "work queues", fmt::format("unbound kernel work may run on core {}", cpu), where,
             "write a mask without the core into that file at start-up; isolcpus=domain,N does so");
}

Finding timers(const Case& of) {
  const std::string where = "/proc/sys/kernel/timer_migration";
  if (!of.machine.neighbourhood.timers_migrate.value_or(false))
    return fine("timers", "stay on the core that set them", where);
  return bad(Verdict::warn, "timers", "idle cores' timers may fire on the loop's core", where,
             "sysctl kernel.timer_migration=0");
}

Finding unit_cores(const Case& of, int cpu) {
  const std::string where = "CPUAffinity= of takt-executive.service";
  const std::vector<int>& cpus = of.machine.neighbourhood.unit_cpus;
  if (!contains(cpus, cpu))
    return fine("unit", cpus.empty() ? "names no core" : "its other threads stay off the loop's core", where);
  return bad(Verdict::warn, "unit", fmt::format("its other threads share core {} with the loop", cpu), where,
             "systemctl edit takt-executive: CPUAffinity= (empty), then CPUAffinity= another core");
}

Finding huge_pages(const Case& of) {
  const std::string where = "/sys/kernel/mm/transparent_hugepage/enabled";
  const std::string& chosen = of.machine.neighbourhood.huge_pages;
  if (chosen != "always") return fine("huge pages", chosen.empty() ? "none" : chosen, where);
  return bad(Verdict::warn, "huge pages", "always: the kernel moves memory to make them, and stalls who uses it", where,
             "echo madvise > /sys/kernel/mm/transparent_hugepage/enabled, or boot with transparent_hugepage=madvise");
}

Finding swap(const Case& of) {
  if (!of.machine.neighbourhood.has_swap) return fine("swap", "none", "/proc/swaps");
  return bad(Verdict::warn, "swap", "in use: the executive's memory is locked, a policy's is not", "/proc/swaps",
             "swapoff -a, and take it out of /etc/fstab");
}

Finding idle_driver(const Case& of) {
  const std::string where = "/sys/devices/system/cpu/cpuidle/current_driver";
  const std::string& driver = of.machine.neighbourhood.idle_driver;
  if (driver != "acpi_idle" || of.machine.processor_vendor != "GenuineIntel")
    return fine("idle driver", driver.empty() ? "none" : driver, where);
  return bad(Verdict::warn, "idle driver", "acpi_idle: what the firmware says of sleep states may be wrong", where,
             "boot without intel_idle.max_cstate=0");
}

Finding tuned(const Case& of) {
  const std::string where = "/etc/tuned/active_profile";
  const std::string& profile = of.machine.neighbourhood.tuned_profile;
  if (profile.empty() || profile.starts_with("realtime") || profile.starts_with("latency-performance") ||
      profile.starts_with("network-latency") || profile.starts_with("cpu-partitioning"))
    return fine("tuned", profile.empty() ? "sets nothing" : profile, where);
  return bad(Verdict::warn, "tuned", profile + ": may change frequencies and sleep states back", where,
             "tuned-adm profile realtime (package tuned-profiles-realtime), or tuned-adm off");
}

}  // namespace

void judge_neighbourhood(const Case& of, Findings& into) {
  if (of.robot != nullptr && of.robot->control.cpu) {
    const int cpu = *of.robot->control.cpu;
    into.push_back(hardware_threads(of, cpu));
    into.push_back(real_time_threads(of, cpu));
    into.push_back(irqbalance(of));
    into.push_back(work_queues(of, cpu));
    into.push_back(timers(of));
    into.push_back(unit_cores(of, cpu));
  }
  into.push_back(huge_pages(of));
  into.push_back(swap(of));
  into.push_back(idle_driver(of));
  into.push_back(tuned(of));
}

}  // namespace takt::doctor
