// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/realtime_setup.hpp"

#include <fcntl.h>
#include <linux/capability.h>
#include <malloc.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <fstream>
#include <optional>
#include <system_error>

namespace takt::runtime {
namespace {

// Rings, stacks, code and heap take about 60 MiB. A limit that only just admits mlockall would make a later allocation
// fail.
constexpr rlim_t kLockedMemoryNeeded = rlim_t{256} << 20U;

std::string why() {
  return std::generic_category().message(errno);
}

bool has_capability(unsigned capability) {
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  __user_cap_data_struct data[2]{};
  if (syscall(SYS_capget, &header, data) != 0) return false;
  return (data[capability / 32].effective >> (capability % 32) & 1U) != 0;
}

// The limit after raising it as far as this process may.
rlim_t raise_limit(__rlimit_resource resource) {
  rlimit limit{};
  if (getrlimit(resource, &limit) != 0) return 0;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(resource, &limit);
  return limit.rlim_cur;
}

std::optional<std::int64_t> read_number(const char* path) {
  std::ifstream file(path);
  std::int64_t value = 0;
  if (!(file >> value)) return std::nullopt;
  return value;
}

SetupStep step(std::string name, bool essential, bool ok, std::string detail) {
  return {std::move(name), ok, essential, std::move(detail)};
}

// Freed memory stays with the process, large blocks come from the heap, and there is one heap: no page faults later.
SetupStep tune_allocator() {
  // No other thread exists yet. NOLINTNEXTLINE(concurrency-mt-unsafe)
  const bool ok = mallopt(M_TRIM_THRESHOLD, -1) == 1 && mallopt(M_MMAP_MAX, 0) == 1 && mallopt(M_ARENA_MAX, 1) == 1;
  return step("allocator", false, ok, ok ? "memory is never given back" : "mallopt refused: use glibc's allocator");
}

SetupStep lock_memory() {
  const rlim_t limit = raise_limit(RLIMIT_MEMLOCK);
  if (!has_capability(CAP_IPC_LOCK) && limit < kLockedMemoryNeeded) {
    return step("locked_memory", true, false,
                "RLIMIT_MEMLOCK is " + std::to_string(limit >> 10U) +
                    " KiB: raise it (LimitMEMLOCK=infinity, ulimit -l unlimited) or grant CAP_IPC_LOCK");
  }
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    return step("locked_memory", true, false,
                "mlockall: " + why() + ": raise RLIMIT_MEMLOCK (LimitMEMLOCK=infinity) or grant CAP_IPC_LOCK");
  }
  return step("locked_memory", true, true, "all pages locked, now and in future");
}

SetupStep hold_cpu_awake(ipc::Descriptor& held) {
  constexpr const char* kDevice = "/dev/cpu_dma_latency";
  ipc::Descriptor device(open(kDevice, O_WRONLY | O_CLOEXEC));
  const std::int32_t microseconds_allowed = 0;
  if (!device.is_open() ||
      write(device.get(), &microseconds_allowed, sizeof microseconds_allowed) != sizeof microseconds_allowed) {
    return step("cpu_dma_latency", false, false,
                std::string(kDevice) + ": " + why() + ": give this user write access to it (udev rule)");
  }
  held = std::move(device);
  return step("cpu_dma_latency", false, true, "processor sleep states limited to 0 us wake-up latency");
}

// Before Linux 6.12 a thread that does not sleep enough is stopped for the rest of the throttling period.
SetupStep check_throttling(const config::Control& control) {
  const auto runtime = read_number("/proc/sys/kernel/sched_rt_runtime_us");
  const auto period = read_number("/proc/sys/kernel/sched_rt_period_us");
  if (!runtime || !period) return step("rt_throttling", false, true, "not known to this kernel");
  if (*runtime < 0 || *runtime >= *period) return step("rt_throttling", false, true, "off");
  const std::string share = std::to_string(*runtime) + " of " + std::to_string(*period) + " us";
  const bool spins = control.wake == config::WakeMode::hybrid;
  const double spin_share = spins ? control.spin.seconds() / control.period.seconds() : 0.0;
  if (spin_share >= 0.8 * static_cast<double>(*runtime) / static_cast<double>(*period)) {
    return step("rt_throttling", false, false,
                "real-time threads may run " + share + ", and spinning takes " +
                    std::to_string(static_cast<int>(spin_share * 100)) +
                    " %: shorten control.spin, or set kernel.sched_rt_runtime_us=-1");
  }
  return step("rt_throttling", false, true, "real-time threads may run " + share);
}

SetupStep describe_wake(const config::Control& control) {
  if (control.wake == config::WakeMode::sleep) return step("wake", false, true, "sleep");
  const double percent = 100 * control.spin.seconds() / control.period.seconds();
  return step("wake", false, true,
              "hybrid: spins for the last " + std::to_string(control.spin.ns / 1000) + " us, which costs " +
                  std::to_string(static_cast<int>(percent)) + " % of one core");
}

SetupStep check_kernel() {
  const bool preempt_rt = read_number("/sys/kernel/realtime").value_or(0) == 1;
  return step("kernel", false, preempt_rt,
              preempt_rt ? "PREEMPT_RT" : "not PREEMPT_RT: wake-up latency is unbounded; install linux-image-rt");
}

SetupStep prefault_stack() {
  constexpr std::size_t kBytes = std::size_t{256} << 10U;
  [[maybe_unused]] volatile std::uint8_t stack[kBytes];
  for (std::size_t at = 0; at < kBytes; at += 4096) stack[at] = 0;
  return step("stack", false, true, std::to_string(kBytes >> 10U) + " KiB pre-faulted");
}

SetupStep minimise_timer_slack() {
  const bool ok = prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL) == 0;
  return step("timer_slack", false, ok, ok ? "1 ns" : "prctl: " + why());
}

SetupStep pin(const config::Control& control) {
  cpu_set_t set;
  CPU_ZERO(&set);
  if (!control.cpu) {
    // Not where this process happens to be held: the unit keeps its other threads off the control core.
    for (std::size_t cpu = 0; cpu < CPU_SETSIZE; ++cpu) CPU_SET(cpu, &set);
    const bool ok = sched_setaffinity(0, sizeof set, &set) == 0;
    return step("affinity", true, true, ok ? "none: free to run on every core" : "as inherited: " + why());
  }
  const bool possible = *control.cpu >= 0 && *control.cpu < CPU_SETSIZE;
  if (possible) CPU_SET(static_cast<std::size_t>(*control.cpu), &set);
  const std::string core = "core " + std::to_string(*control.cpu);
  if (!possible || sched_setaffinity(0, sizeof set, &set) != 0) {
    return step("affinity", true, false,
                core + " cannot be had (this machine has " + std::to_string(sysconf(_SC_NPROCESSORS_ONLN)) +
                    " cores): change control.cpu, or write `cpu: none`");
  }
  return step("affinity", true, true, "pinned to " + core);
}

SetupStep make_fifo(const config::Control& control) {
  const rlim_t limit = raise_limit(RLIMIT_RTPRIO);
  sched_param parameters{};
  parameters.sched_priority = control.priority;
  if (sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters) != 0) {
    return step("sched_fifo", true, false,
                "SCHED_FIFO priority " + std::to_string(control.priority) + ": " + why() + ": RLIMIT_RTPRIO is " +
                    std::to_string(limit) + ": raise it (LimitRTPRIO=99, ulimit -r 99) or grant CAP_SYS_NICE");
  }
  return step("sched_fifo", true, true, "priority " + std::to_string(control.priority));
}

}  // namespace

ProcessSetup prepare_process(const config::Control& control) {
  ProcessSetup setup;
  setup.steps.push_back(check_kernel());
  setup.steps.push_back(tune_allocator());
  setup.steps.push_back(lock_memory());
  setup.steps.push_back(hold_cpu_awake(setup.cpu_dma_latency));
  setup.steps.push_back(check_throttling(control));
  setup.steps.push_back(describe_wake(control));
  return setup;
}

std::vector<SetupStep> prepare_thread(const config::Control& control) {
  return {prefault_stack(), minimise_timer_slack(), pin(control), make_fifo(control)};
}

bool is_realtime(const std::vector<SetupStep>& steps) {
  return std::ranges::none_of(steps, [](const SetupStep& each) { return each.essential && !each.ok; });
}

}  // namespace takt::runtime
