// SPDX-License-Identifier: Apache-2.0
#include "simulation/sensor_path.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "simulation/chance.hpp"

namespace takt::simulation {
namespace {

MonoTime delivery_of(MonoTime published_at, const SensorFaults& faults) {
  if (faults.burst.ns == 0) return published_at;
  const std::int64_t turns = (published_at - faults.burst_since).ns / faults.burst.ns + 1;
  return faults.burst_since + faults.burst * turns;
}

// Believable by its form: numbers of the right size, stamps as they are.
void say_the_opposite(Sensed& sensed) {
  for (float& value : std::span(sensed.sample.values).first(sensed.sample.value_count)) value = -value;
  if (!sensed.pixels) return;
  std::vector<std::uint8_t> negative = *sensed.pixels;
  for (std::uint8_t& byte : negative) byte = static_cast<std::uint8_t>(0xFF - byte);
  sensed.pixels = std::make_shared<const std::vector<std::uint8_t>>(std::move(negative));
}

}  // namespace

void SensorPath::take(const Sensed& sensed, const SensorFaults& faults) {
  if (happens(faults.drop, random_)) return;
  Sensed& held = held_.emplace_back(sensed, delivery_of(sensed.sample.published_at, faults)).sensed;
  if (faults.frozen && before_freeze_.sample.sequence != 0) {
    std::ranges::copy(before_freeze_.sample.values, held.sample.values);
    held.pixels = before_freeze_.pixels;
  } else {
    before_freeze_ = sensed;
  }
  if (happens(faults.lies, random_)) say_the_opposite(held);
}

std::optional<Sensed> SensorPath::deliver(MonoTime now) {
  if (held_.empty() || held_.front().delivered_at > now) return std::nullopt;
  Sensed sensed = std::move(held_.front().sensed);
  held_.pop_front();
  return sensed;
}

}  // namespace takt::simulation
