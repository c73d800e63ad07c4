// SPDX-License-Identifier: Apache-2.0
// Kernel, cores, frequency, sleep states, interrupts, clock: what decides when a thread runs.
// Source of the settings: Documentation/admin-guide/kernel-parameters, Documentation/admin-guide/pm/{cpufreq,cpuidle}.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>

#include <algorithm>
#include <optional>

#include "systemd/doctor/judge.hpp"

namespace takt::doctor {
namespace {

constexpr std::int64_t kLongestWakeUp_us = 20;  // of a sleep state that a 1 kHz loop bears
constexpr double kMostSteal = 0.001;

std::optional<int> control_cpu(const Case& of) {
  return of.robot == nullptr ? std::nullopt : of.robot->control.cpu;
}

Finding kernel(const Snapshot& machine) {
  const std::string found = machine.kernel_release;
  if (machine.kernel_version.find("PREEMPT_RT") != std::string::npos)
    return fine("kernel", found + ", PREEMPT_RT", "uname");
  return bad(Verdict::fail, "kernel", found + ", not PREEMPT_RT: wake-up latency is unbounded", "uname",
             "apt-get install linux-image-rt-amd64, then boot it");
}

Finding cores(const Case& of) {
  const auto& cpus = of.machine.cpus;
  const std::string found = fmt::format("{} online", cpus.size());
  const auto wanted = control_cpu(of);
  if (wanted && !contains(cpus, *wanted))
    return bad(Verdict::fail, "cores", fmt::format("{}, but control.cpu is {}", found, *wanted),
               "/sys/devices/system/cpu/online", "name an existing core in the robot file, or write `cpu: none`");
  if (cpus.size() < 2)
    return bad(Verdict::warn, "cores", found, "/sys/devices/system/cpu/online",
               "one core is shared by the loop and everything else: use a machine with two or more");
  return fine("cores", found, "/sys/devices/system/cpu/online");
}

Finding isolated(const Case& of) {
  const std::string where = "/sys/devices/system/cpu/isolated";
  const auto wanted = control_cpu(of);
  if (!wanted)
    return bad(Verdict::warn, "isolcpus", "the robot file pins the loop to no core", "control.cpu",
               "write `cpu: N` into the robot file, and isolate core N");
  if (contains(of.machine.isolated, *wanted))
    return fine("isolcpus", fmt::format("core {} is set apart", *wanted), where);
  return bad(Verdict::warn, "isolcpus", fmt::format("core {} runs whatever else there is", *wanted), where,
             fmt::format("add isolcpus=managed_irq,domain,{} to GRUB_CMDLINE_LINUX in /etc/default/grub, update-grub, "
                         "reboot",
                         *wanted));
}

// An option, no fault: a loop that sleeps every period gains nothing from it, and each sleep costs more with it.
Finding scheduler_ticks(const Case& of) {
  const auto wanted = control_cpu(of);
  const bool stopped = wanted && contains(of.machine.nohz_full, *wanted);
  return fine("nohz_full",
              stopped ? fmt::format("core {} has no scheduler tick while one thread runs", *wanted)
                      : "not used: helps loops that spin, not those that sleep",
              "/sys/devices/system/cpu/nohz_full");
}

Finding governor(const Snapshot& machine) {
  const std::string where = "/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor";
  if (machine.governor.empty()) return fine("governor", "the kernel does not change frequencies", where);
  if (machine.governor == "performance") return fine("governor", "performance", where);
  return bad(Verdict::warn, "governor", machine.governor + ": the first work after a pause runs slowly", where,
             "cpupower frequency-set -g performance (package linux-cpupower)");
}

// As the kernel decides: the first class that fits counts, and no other.
bool may_write(const FileRights& file, const Account& account) {
  if (account.id == file.owner) return (file.mode & S_IWUSR) != 0;
  if (std::ranges::find(account.groups, file.group) != account.groups.end()) return (file.mode & S_IWGRP) != 0;
  return (file.mode & S_IWOTH) != 0;
}

// What root may do says nothing of the packaged executive, which runs as a user of its own.
bool judged_for_service_user(const Snapshot& machine) {
  return machine.examined_by_root && machine.service_user.has_value();
}

bool executive_may_hold_awake(const Snapshot& machine) {
  if (!machine.cpu_dma_latency) return false;
  return judged_for_service_user(machine) ? may_write(*machine.cpu_dma_latency, *machine.service_user)
                                          : machine.cpu_dma_latency->writable_by_us;
}

Finding sleep_states(const Snapshot& machine) {
  const std::string where = "/sys/devices/system/cpu/cpu*/cpuidle, /dev/cpu_dma_latency";
  const SleepState* deepest = nullptr;
  for (const SleepState& state : machine.sleep_states)
    if (!state.disabled && (deepest == nullptr || state.exit_latency_us > deepest->exit_latency_us)) deepest = &state;
  if (deepest == nullptr || deepest->exit_latency_us <= kLongestWakeUp_us)
    return fine("sleep states",
                deepest == nullptr ? "none" : fmt::format("{} us at most to wake up", deepest->exit_latency_us), where);
  const std::string found = fmt::format("{} takes {} us to wake up from", deepest->name, deepest->exit_latency_us);
  if (executive_may_hold_awake(machine))
    return fine("sleep states", found + "; the executive forbids it while it runs", where);
  if (!machine.cpu_dma_latency || !judged_for_service_user(machine))
    return bad(Verdict::warn, "sleep states", found, where,
               "let the executive write /dev/cpu_dma_latency (its unit does), or boot with processor.max_cstate=1");
  const FileRights& device = *machine.cpu_dma_latency;
  return bad(Verdict::warn, "sleep states",
             fmt::format("{}, and user takt may not write /dev/cpu_dma_latency (owner {}, group {}, mode {:04o})",
                         found, device.owner, device.group, device.mode),
             where,
             "systemd-tmpfiles --create takt.conf gives /dev/cpu_dma_latency to group takt; or boot with "
             "processor.max_cstate=1");
}

Finding interrupts(const Case& of) {
  const std::string where = "/proc/irq/*/effective_affinity_list";
  const auto wanted = control_cpu(of);
  if (!wanted) return fine("interrupts", "no core is reserved for the loop", where);
  std::vector<std::string> names;
  for (const Interrupt& interrupt : of.machine.interrupts)
    if (!interrupt.name.empty() && contains(interrupt.cpus, *wanted))
      names.push_back(fmt::format("{} ({})", interrupt.number, interrupt.name));
  if (names.empty()) return fine("interrupts", fmt::format("no device interrupts core {}", *wanted), where);
  const std::size_t count = names.size();
  if (names.size() > 3) names.resize(3);
  return bad(Verdict::warn, "interrupts",
             fmt::format("core {} takes {}: {}{}", *wanted, count, fmt::join(names, ", "), count > 3 ? ", ..." : ""),
             where,
             "systemctl enable --now takt-irq-affinity; end irqbalance or ban the core in it; NVMe queues: "
             "isolcpus=managed_irq,domain,N");
}

Finding clock(const Snapshot& machine) {
  const std::string where = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
  constexpr std::string_view kFast[] = {"tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page"};
  if (machine.clocksource.empty() || std::ranges::find(kFast, machine.clocksource) != std::end(kFast))
    return fine("clock source", machine.clocksource.empty() ? "not told" : machine.clocksource, where);
  return bad(
      Verdict::warn, "clock source", machine.clocksource + ": each reading costs a microsecond or more", where,
      "find out why the kernel distrusts the TSC (journalctl -k | grep -i tsc); tsc=reliable if you know better");
}

Finding platform(const Snapshot& machine) {
  const std::string where = "/proc/cpuinfo, /proc/stat";
  const std::string steal = fmt::format("{:.2f} % of the time stolen since boot", 100 * machine.steal_share);
  if (machine.hypervisor)
    return bad(Verdict::fail, "platform", "a virtual machine, " + steal, where,
               "nothing inside it bounds what the host does: run on the metal");
  if (machine.steal_share > kMostSteal)
    return bad(Verdict::warn, "platform", steal, where, "find who shares this processor");
  return fine("platform", "not a virtual machine", where);
}

}  // namespace

void judge_processor(const Case& of, Findings& into) {
  into.push_back(kernel(of.machine));
  into.push_back(platform(of.machine));
  into.push_back(cores(of));
  into.push_back(isolated(of));
  into.push_back(scheduler_ticks(of));
  into.push_back(governor(of.machine));
  into.push_back(sleep_states(of.machine));
  into.push_back(interrupts(of));
  into.push_back(clock(of.machine));
}

}  // namespace takt::doctor
