// The way from an outside sensor to the policy host, and what a perturbation does to it: samples lost, held back and
// delivered together, or old values under fresh stamps. Pure, virtual time. Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <deque>

#include "executive/contract/sensor_sample.hpp"
#include "monitor/panel/perturbation.hpp"
#include "monitor/panel/random.hpp"

namespace takt::panel {

class SensorFeed {
 public:
  SensorFeed(const Disturbance& disturbance, std::uint64_t seed);  // `disturbance` outlives this

  void take(SensorSample sample);
  // What the host's mailbox holds at `now`; sequence 0 before the first sample. `now` never runs backwards.
  const SensorSample& newest(MonoTime now);

 private:
  struct Held {
    SensorSample sample;
    MonoTime delivered_at;
  };
  [[nodiscard]] MonoTime delivery_of(MonoTime published_at) const;

  const Disturbance& disturbance_;
  Random losses_;
  std::deque<Held> held_;
  SensorSample newest_, before_freeze_;
};

}  // namespace takt::panel
