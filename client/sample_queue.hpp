// SPDX-License-Identifier: Apache-2.0
// What came from one sensor between two observations: bounded, the newest survive, the others are counted.
// Thread rule: one thread; nothing allocates after construction.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "client/takt/client.h"
#include "config/robot_config.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::client {

class SampleQueue {
 public:
  // Precondition: sensor.queue > 0. `sensor` outlives this.
  explicit SampleQueue(const config::Sensor& sensor);
  // Attaches if due, then takes all that came. `newest`: changes where a sample was read, usable or not. `lockstep`: no
  // clock knows when that is.
  void take_all(policy_host::SensorLink& link, MonoTime now, bool lockstep, SensorSample& newest);
  // Hands over what is waiting, and begins anew. The view's memory stays the same.
  void show(takt_queue& view);
  // What the view holds, sample by sample, until the next show().
  [[nodiscard]] std::span<const SensorSample> shown() const { return std::span(shown_).first(shown_count_); }
  // Nothing is waiting, nothing was lost.
  void forget();

 private:
  void put(const SensorSample& sample);
  const config::Sensor& sensor_;
  std::vector<SensorSample> waiting_;  // a ring of sensor.queue
  std::size_t first_ = 0, count_ = 0;
  std::uint64_t dropped_ = 0, session_ = 0;
  std::vector<SensorSample> shown_;  // room for sensor.queue
  std::size_t shown_count_ = 0;
  std::vector<float> values_;
  std::vector<std::int64_t> sensed_;
};

}  // namespace takt::client
