// SPDX-License-Identifier: Apache-2.0
#include "cli/run/cpu_hog.hpp"

#include <fmt/format.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace takt::cli {
namespace {

std::int64_t monotonic_ns() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * seconds(1).ns + now.tv_nsec;
}

// Runs in the child: only calls that are safe between fork and exit.
[[noreturn]] void occupy_until(std::int64_t end_ns, pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(0);
  while (monotonic_ns() < end_ns) {
  }
  _exit(0);
}

std::expected<void, std::string> place(pid_t hog, int cpu, const HogLoad& load) {
  cpu_set_t only;
  CPU_ZERO(&only);
  CPU_SET(static_cast<std::size_t>(cpu), &only);
  if (sched_setaffinity(hog, sizeof only, &only) != 0)
    return std::unexpected(fmt::format("cannot occupy CPU {}: {}", cpu, std::strerror(errno)));
  if (load.fifo_priority == 0) {
    setpriority(PRIO_PROCESS, static_cast<id_t>(hog), load.nice);
    return {};
  }
  const sched_param wanted{.sched_priority = load.fifo_priority};
  if (sched_setscheduler(hog, SCHED_FIFO, &wanted) != 0)
    return std::unexpected(fmt::format("SCHED_FIFO {} was not granted to the hog of CPU {}: {}", load.fifo_priority,
                                       cpu, std::strerror(errno)));
  return {};
}

}  // namespace

CpuHogs::~CpuHogs() {
  for (const pid_t hog : running_) {
    kill(hog, SIGKILL);
    waitpid(hog, nullptr, 0);
  }
}

std::expected<void, std::string> CpuHogs::start(const HogLoad& load) {
  const Duration longest = load.fifo_priority == 1 ? kLongestLowestFifoHog : kLongestFifoHog;
  if (load.fifo_priority != 0 && load.length > longest)
    return std::unexpected(
        fmt::format("a hog at real-time priority {} may last {} s", load.fifo_priority, longest.seconds()));
  const pid_t parent = getpid();
  const std::int64_t end_ns = monotonic_ns() + load.length.ns;
  const std::size_t before = running_.size();
  for (const int cpu : load.cpus) {
    for (std::size_t i = 0; i < load.per_cpu; ++i) {
      const pid_t hog = fork();
      if (hog == 0) occupy_until(end_ns, parent);
      if (hog < 0) return std::unexpected(fmt::format("cannot fork a hog: {}", std::strerror(errno)));
      running_.push_back(hog);
      if (auto placed = place(hog, cpu, load); !placed) {
        for (std::size_t j = before; j < running_.size(); ++j) kill(running_[j], SIGKILL);
        return placed;
      }
    }
  }
  return {};
}

void CpuHogs::reap() {
  std::erase_if(running_, [](pid_t hog) { return waitpid(hog, nullptr, WNOHANG) != 0; });
}

std::vector<int> usable_cpus() {
  std::vector<int> cpus;
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) return cpus;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu)
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &allowed)) cpus.push_back(cpu);
  return cpus;
}

}  // namespace takt::cli
