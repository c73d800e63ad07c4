// SPDX-License-Identifier: Apache-2.0
#include "systemd/doctor/wakeup_probe.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <ctime>
#include <thread>

#include "executive/ipc/descriptor.hpp"
#include "systemd/doctor/interference.hpp"
#include "systemd/doctor/own_load.hpp"

namespace takt::doctor {
namespace {

std::int64_t now_ns() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

// As the executive does: no sleep state that takes time to wake up from, for as long as the result is open.
ipc::Descriptor hold_awake(const std::string& root) {
  ipc::Descriptor device(open((root + "/dev/cpu_dma_latency").c_str(), O_WRONLY | O_CLOEXEC));
  const std::int32_t microseconds_allowed = 0;
  if (device.is_open() &&
      write(device.get(), &microseconds_allowed, sizeof microseconds_allowed) != sizeof microseconds_allowed)
    device.close();
  return device;
}

bool become_real_time(const ProbePlan& plan) {
  if (plan.cpu && *plan.cpu >= 0 && *plan.cpu < CPU_SETSIZE) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(static_cast<std::size_t>(*plan.cpu), &set);
    pthread_setaffinity_np(pthread_self(), sizeof set, &set);
  }
  sched_param parameters{};
  parameters.sched_priority = plan.priority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0;
}

std::vector<std::int64_t> sleep_and_look(const ProbePlan& plan) {
  const std::int64_t count = std::max<std::int64_t>(1, plan.length.ns / plan.period.ns);
  std::vector<std::int64_t> lateness(static_cast<std::size_t>(count));
  std::int64_t due = now_ns();
  for (std::int64_t& late : lateness) {
    due += plan.period.ns;
    const timespec at{due / 1'000'000'000, due % 1'000'000'000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
    late = std::max<std::int64_t>(0, now_ns() - due);
    if (late > plan.period.ns) due += late / plan.period.ns * plan.period.ns;  // slots that are lost stay lost
  }
  return lateness;
}

}  // namespace

WakeupLatency summarise(std::vector<std::int64_t> lateness_ns, bool real_time) {
  WakeupLatency latency;
  latency.real_time = real_time;
  latency.samples = lateness_ns.size();
  for (const std::int64_t late : lateness_ns) {
    const auto bucket = static_cast<std::size_t>(std::bit_width(static_cast<std::uint64_t>(late) / 1000 / 2));
    if (latency.histogram.size() <= bucket) latency.histogram.resize(bucket + 1);
    ++latency.histogram[bucket];
  }
  std::ranges::sort(lateness_ns);
  const auto quantile = [&lateness_ns](double share) {
    const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(lateness_ns.size())));
    return lateness_ns[std::clamp<std::size_t>(rank, 1, lateness_ns.size()) - 1];
  };
  latency.p50_ns = quantile(0.5);
  latency.p99_ns = quantile(0.99);
  latency.p999_ns = quantile(0.999);
  latency.max_ns = lateness_ns.back();
  if (lateness_ns.size() >= kFewestForP99999) {
    latency.p99999_ns = quantile(0.99999);
    latency.beyond_p99999 =
        static_cast<std::uint64_t>(lateness_ns.end() - std::ranges::upper_bound(lateness_ns, *latency.p99999_ns));
  }
  return latency;
}

WakeupLatency measure_wakeups(const ProbePlan& plan, const std::string& root) {
  const bool locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  const ipc::Descriptor awake = hold_awake(root);
  std::optional<OwnLoad> load;
  if (plan.load_in) load.emplace(*plan.load_in, plan.cpu);
  const Interference before = read_interference(root, plan.cpu);
  bool real_time = false;
  std::vector<std::int64_t> lateness;
  std::thread([&] {
    real_time = become_real_time(plan);
    lateness = sleep_and_look(plan);
  }).join();
  const Interference after = read_interference(root, plan.cpu);
  munlockall();
  WakeupLatency latency = summarise(std::move(lateness), real_time && locked);
  latency.held_awake = awake.is_open();
  latency.cpu = plan.cpu;
  latency.own_load = load.has_value();
  latency.interference = interference_between(before, after);
  return latency;
}

}  // namespace takt::doctor
