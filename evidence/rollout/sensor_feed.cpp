#include "evidence/rollout/sensor_feed.hpp"

#include "simulation/chance.hpp"

namespace takt::panel {

SensorFeed::SensorFeed(const Disturbance& disturbance, std::uint64_t seed, std::uint64_t stream)
    : disturbance_(disturbance), path_(plant::seed_for(seed, stream)) {}

void SensorFeed::take(const SensorSample& sample) {
  const MonoTime at = sample.published_at;
  path_.take(sample, {.drop = disturbance_.dose(Trouble::sensor_dropout, at),
                      .frozen = disturbance_.in_first_part(Trouble::camera_freeze, at),
                      .burst = disturbance_.delay(Trouble::sensor_burst, at),
                      .burst_since = disturbance_.begins()});
}

const SensorSample& SensorFeed::newest(MonoTime now) {
  while (const auto delivered = path_.deliver(now)) newest_ = *delivered;
  return newest_;
}

}  // namespace takt::panel
