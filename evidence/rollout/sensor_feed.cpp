// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/sensor_feed.hpp"

#include <utility>

#include "simulation/chance.hpp"

namespace takt::evidence {

SensorFeed::SensorFeed(const Disturbance& disturbance, std::uint64_t seed, std::uint64_t stream)
    : disturbance_(disturbance), path_(simulation::seed_for(seed, stream)) {}

void SensorFeed::take(const simulation::Sensed& sensed) {
  const MonoTime at = sensed.sample.published_at;
  path_.take(sensed, {.drop = disturbance_.dose(Trouble::sensor_dropout, at),
                      .lies = disturbance_.dose(Trouble::sensor_lies, at),
                      .frozen = disturbance_.in_first_part(Trouble::camera_freeze, at),
                      .burst = disturbance_.delay(Trouble::sensor_burst, at),
                      .burst_since = disturbance_.begins(Trouble::sensor_burst)});
}

const simulation::Sensed& SensorFeed::newest(MonoTime now) {
  while (auto delivered = path_.deliver(now)) newest_ = std::move(*delivered);
  return newest_;
}

}  // namespace takt::evidence
