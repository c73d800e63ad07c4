// SPDX-License-Identifier: Apache-2.0
// When a perturbation troubles the way from an outside sensor to the policy host, or from the IMU to the executive
// (simulation/sensor_path.hpp says how), and what the reader's mailbox holds. Numbers and images alike. Pure, virtual
// time. Thread rule: one thread at a time.
#pragma once

#include <cstdint>

#include "evidence/rollout/perturbation.hpp"
#include "simulation/sensor_path.hpp"

namespace takt::evidence {

class SensorFeed {
 public:
  // `disturbance` outlives this. Feeds of different `stream` lose samples independently.
  SensorFeed(const Disturbance& disturbance, std::uint64_t seed, std::uint64_t stream);

  void take(const simulation::Sensed& sensed);
  // What the mailbox holds at `now`; sequence 0 before the first sample. `now` never runs backwards.
  const simulation::Sensed& newest(MonoTime now);

 private:
  const Disturbance& disturbance_;
  simulation::SensorPath path_;
  simulation::Sensed newest_;
};

}  // namespace takt::evidence
