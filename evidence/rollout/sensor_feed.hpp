// When a perturbation troubles the way from an outside sensor to the policy host (simulation/sensor_path.hpp says
// how), and what the host's mailbox holds. Pure, virtual time. Thread rule: one thread at a time.
#pragma once

#include <cstdint>

#include "evidence/rollout/perturbation.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "simulation/sensor_path.hpp"

namespace takt::panel {

class SensorFeed {
 public:
  SensorFeed(const Disturbance& disturbance, std::uint64_t seed);  // `disturbance` outlives this

  void take(const SensorSample& sample);
  // What the host's mailbox holds at `now`; sequence 0 before the first sample. `now` never runs backwards.
  const SensorSample& newest(MonoTime now);

 private:
  const Disturbance& disturbance_;
  plant::SensorPath path_;
  SensorSample newest_;
};

}  // namespace takt::panel
