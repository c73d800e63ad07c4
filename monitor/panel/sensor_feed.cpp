#include "monitor/panel/sensor_feed.hpp"

#include <algorithm>

namespace takt::panel {
namespace {

constexpr std::uint64_t kLossStream = 201;

}  // namespace

SensorFeed::SensorFeed(const Disturbance& disturbance, std::uint64_t seed)
    : disturbance_(disturbance), losses_(seed, kLossStream) {}

MonoTime SensorFeed::delivery_of(MonoTime published_at) const {
  const Duration every = disturbance_.delay(Trouble::sensor_burst, published_at);
  if (every.ns == 0) return published_at;
  const std::int64_t turns = (published_at - disturbance_.begins()).ns / every.ns + 1;
  return disturbance_.begins() + every * turns;
}

void SensorFeed::take(SensorSample sample) {
  const MonoTime at = sample.published_at;
  if (losses_.happens(disturbance_.dose(Trouble::sensor_dropout, at))) return;
  const bool frozen = disturbance_.in_first_part(Trouble::camera_freeze, at) && before_freeze_.sequence != 0;
  if (frozen)
    std::ranges::copy(before_freeze_.values, sample.values);
  else
    before_freeze_ = sample;
  held_.push_back({sample, delivery_of(at)});
}

const SensorSample& SensorFeed::newest(MonoTime now) {
  while (!held_.empty() && held_.front().delivered_at <= now) {
    newest_ = held_.front().sample;
    held_.pop_front();
  }
  return newest_;
}

}  // namespace takt::panel
