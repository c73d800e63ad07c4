// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/wake_ups.hpp"

#include <cmath>

namespace takt::evidence {
namespace {

constexpr std::uint64_t kWakeStream = 601, kPhaseStream = 602;
constexpr Duration kLeastLateness = microseconds(5), kUsualLateness = microseconds(40);

}  // namespace

double stop_phase(std::uint64_t seed) {
  return Random(seed, kPhaseStream).unit();
}

WakeUps::WakeUps(const Disturbance& disturbance, Duration period, std::uint64_t seed)
    : disturbance_(disturbance),
      preempted_share_(kPreemptionsPerSecond * period.seconds()),
      wakes_(seed, kWakeStream),
      phase_(stop_phase(seed)) {}

MonoTime WakeUps::free_again(Trouble trouble, Duration every, MonoTime at) const {
  const Duration taken = disturbance_.delay(trouble, at);
  if (taken.ns == 0) return at;
  const Duration phase{std::llround(static_cast<double>(every.ns) * phase_)};
  const Duration since_first = at - disturbance_.begins(trouble) - phase;
  if (since_first.ns < 0) return at;
  const Duration since_last{since_first.ns % every.ns};
  return since_last < taken ? at + (taken - since_last) : at;
}

MonoTime WakeUps::after(MonoTime due) {
  const double usual = wakes_.between(static_cast<double>(kLeastLateness.ns), static_cast<double>(kUsualLateness.ns));
  const double dose_ms = disturbance_.dose(Trouble::scheduler_preemption, due);
  const bool preempted = dose_ms > 0 && wakes_.happens(preempted_share_);
  const MonoTime free = free_again(Trouble::cpu_hog, kHogEvery, free_again(Trouble::rt_throttling, kRepeat, due));
  return free + Duration{std::llround(usual + (preempted ? dose_ms * 1e6 : 0))};
}

}  // namespace takt::evidence
