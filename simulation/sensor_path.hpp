// SPDX-License-Identifier: Apache-2.0
// The way from an outside sensor to its mailbox, and what may go wrong on it: samples lost, held back and delivered
// together, old values under fresh stamps, or the opposite of what was sensed. Pure, virtual time. Thread rule: one
// thread at a time.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <random>

#include "executive/contract/mono_time.hpp"
#include "simulation/sensed.hpp"

namespace takt::simulation {

struct SensorFaults {
  double drop = 0;            // share of samples lost, 0..1
  double lies = 0;            // share of samples that say the opposite, 0..1: values negated, images in negative
  bool frozen = false;        // values, or the image, of the last sample before, stamps as they are
  Duration burst = {};        // samples wait for the end of the interval of this length that they fall into; 0: none
  MonoTime burst_since = {};  // where the first interval began
};

class SensorPath {
 public:
  explicit SensorPath(std::uint64_t seed) : random_(seed) {}  // the seed as it is

  void take(const Sensed& sensed, const SensorFaults& faults);
  // The oldest that has arrived by `now` and was not returned yet.
  std::optional<Sensed> deliver(MonoTime now);

 private:
  struct Held {
    Sensed sensed;
    MonoTime delivered_at;
  };
  std::mt19937_64 random_;
  std::deque<Held> held_;
  Sensed before_freeze_;  // sequence 0: none yet
};

}  // namespace takt::simulation
