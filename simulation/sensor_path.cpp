#include "simulation/sensor_path.hpp"

#include <algorithm>

#include "simulation/chance.hpp"

namespace takt::plant {
namespace {

MonoTime delivery_of(MonoTime published_at, const SensorFaults& faults) {
  if (faults.burst.ns == 0) return published_at;
  const std::int64_t turns = (published_at - faults.burst_since).ns / faults.burst.ns + 1;
  return faults.burst_since + faults.burst * turns;
}

}  // namespace

void SensorPath::take(const SensorSample& sample, const SensorFaults& faults) {
  if (happens(faults.drop, losses_)) return;
  SensorSample& held = held_.emplace_back(sample, delivery_of(sample.published_at, faults)).sample;
  if (faults.frozen && before_freeze_.sequence != 0)
    std::ranges::copy(before_freeze_.values, held.values);
  else
    before_freeze_ = sample;
}

std::optional<SensorSample> SensorPath::deliver(MonoTime now) {
  if (held_.empty() || held_.front().delivered_at > now) return std::nullopt;
  const std::optional<SensorSample> sample(held_.front().sample);
  held_.pop_front();
  return sample;
}

}  // namespace takt::plant
