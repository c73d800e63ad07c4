// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/clock.hpp"

#include <cerrno>
#include <ctime>

namespace takt::runtime {
namespace {
constexpr std::int64_t kSecond = 1'000'000'000;

std::int64_t read_ns(clockid_t clock) noexcept {
  timespec at{};
  clock_gettime(clock, &at);
  return std::int64_t{at.tv_sec} * kSecond + at.tv_nsec;
}

}  // namespace

MonoTime SystemClock::now() noexcept {
  return {read_ns(CLOCK_MONOTONIC)};
}

Duration SystemClock::since_boot() noexcept {
  return {read_ns(CLOCK_BOOTTIME)};
}

void SystemClock::sleep_until(MonoTime when) noexcept {
  const timespec at{when.ns / kSecond, when.ns % kSecond};
  // Signals are blocked in the control thread; a debugger's stop may still interrupt the call.
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr) == EINTR) {
  }
}

}  // namespace takt::runtime
