// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/sensor_ages.hpp"

#include <algorithm>

namespace takt::monitor {
namespace {

constexpr std::size_t kObservationsKept = 4096;  // observations: more than any max_age spans
constexpr std::uint64_t kNobodySpoke = UINT64_MAX;

}  // namespace

SensorAges::SensorAges(const config::RobotConfig& robot) : ages_(robot.sensors.size()), oldest_(robot.sensors.size()) {
  for (const config::Sensor& sensor : robot.sensors) names_.push_back(sensor.name);
}

void SensorAges::tick(const TickRecordHeader& header) {
  if (header.observation_published == 0) return;
  published_.push_back({header.observation_published, header.now});
  if (published_.size() > kObservationsKept) published_.pop_front();
}

const SensorAges::Published* SensorAges::observation(std::uint64_t id) const {
  const auto found = std::ranges::lower_bound(published_, id, {}, &Published::observation);
  return found != published_.end() && found->observation == id ? &*found : nullptr;
}

void SensorAges::input(const RecordedPolicyInput& recorded) {
  const Published* const answered =
      recorded.sender == Player::policy ? observation(recorded.input.header.observation_id) : nullptr;
  if (answered == nullptr) return;
  std::vector<MonoTime> newest(names_.size());
  for (const PolicyInputSample& sample : recorded.input.samples)
    if (sample.sensor < newest.size() && sample.sequence != kNobodySpoke)
      newest[sample.sensor] = std::max(newest[sample.sensor], sample.sensed_at);
  std::size_t oldest = newest.size();
  for (std::size_t i = 0; i < newest.size(); ++i) {
    if (!newest[i].is_set()) continue;
    ages_[i].push_back((answered->at - newest[i]).ns);
    if (oldest == newest.size() || newest[i] < newest[oldest]) oldest = i;
  }
  if (oldest != newest.size()) ++oldest_[oldest];
}

std::vector<SensorAge> SensorAges::ages() const {
  std::vector<SensorAge> all;
  for (std::size_t i = 0; i < names_.size(); ++i) {
    std::vector<std::int64_t> samples = ages_[i];
    if (!samples.empty()) all.push_back({names_[i], quantiles_of(samples), oldest_[i]});
  }
  return all;
}

}  // namespace takt::monitor
