// SPDX-License-Identifier: Apache-2.0
// When the control thread of a rollout in virtual time wakes: 5 to 40 us after its period began, as a good kernel does,
// or later where a perturbation keeps it from its core. Three do, each in its own way:
//
//   scheduler_preemption  ten times per second, at instants drawn one by one: this wake-up is `dose` ms late
//   cpu_hog               every kHogEvery, from an instant drawn once: the core is taken for `dose` ms
//   rt_throttling         every second, from an instant drawn once: real-time threads stand still for `dose` ms, which
//                         the kernel takes back for ordinary ones
//
// Thread rule: one thread at a time.
#pragma once

#include <cstdint>

#include "evidence/rollout/perturbation.hpp"
#include "evidence/rollout/random.hpp"

namespace takt::evidence {

// How far into the window the first stop of cpu_hog and rt_throttling is, as a share of the interval between two.
double stop_phase(std::uint64_t seed);

class WakeUps {
 public:
  // `disturbance` outlives this.
  WakeUps(const Disturbance& disturbance, Duration period, std::uint64_t seed);
  // Of the thread that wanted to wake at `due`. Call once per tick, in order.
  [[nodiscard]] MonoTime after(MonoTime due);

 private:
  // Until when a core that is taken away `every` so often is gone; `at` itself: it is there.
  [[nodiscard]] MonoTime free_again(Trouble trouble, Duration every, MonoTime at) const;

  const Disturbance& disturbance_;
  double preempted_share_;  // of wake-ups
  Random wakes_;
  double phase_;
};

}  // namespace takt::evidence
