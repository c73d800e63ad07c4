// SPDX-License-Identifier: Apache-2.0
// CLOCK_MONOTONIC for the shells of programs; what is pure gets time passed in.
// Thread rule: any thread. sleep_until is absolute, so that a pace does not depend on how long the work took, and
// returns early when a signal arrives.
#pragma once

#include <time.h>

#include <cstdint>

#include "executive/contract/mono_time.hpp"

namespace takt {

inline MonoTime monotonic_now() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return MonoTime{} + seconds(now.tv_sec) + nanoseconds(now.tv_nsec);
}

inline void sleep_until(MonoTime when) {
  constexpr std::int64_t kSecond = seconds(1).ns;
  const timespec until{.tv_sec = when.ns / kSecond, .tv_nsec = when.ns % kSecond};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
}

}  // namespace takt
