// SPDX-License-Identifier: Apache-2.0
#include "client/shown_evidence.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "config/observation_shape.hpp"

namespace takt::client {
namespace {

// 0: none of the joints'.
unsigned quantity_of(std::uint32_t kind) {
  switch (kind) {
    case TAKT_TERM_Q:
      return static_cast<unsigned>(ShownQuantity::q);
    case TAKT_TERM_DQ:
      return static_cast<unsigned>(ShownQuantity::dq);
    case TAKT_TERM_TAU:
      return static_cast<unsigned>(ShownQuantity::tau);
    case TAKT_TERM_Q_SETPOINT:
      return static_cast<unsigned>(ShownQuantity::q_setpoint);
    case TAKT_TERM_DQ_OF_DRIVE:
      return static_cast<unsigned>(ShownQuantity::dq_of_drive);
    default:
      return 0;
  }
}

void put_sample(PolicyInputPacker& packer, const SensorSample& sample, std::size_t sensor, bool is_image) {
  const PolicyInputSample shown{sample.sequence, sample.sensed_at, sample.published_at,
                                static_cast<std::uint32_t>(sensor), is_image ? 0 : sample.value_count};
  packer.put(std::span(&shown, 1));
}

std::span<const float> values_in(const SensorSample& sample) {
  return std::span<const float>(sample.values).first(sample.value_count);
}

}  // namespace

ShownEvidence::ShownEvidence(const config::RobotConfig& robot, std::uint64_t policy_hash)
    : joints_(static_cast<std::uint32_t>(robot.joints.size())), payload_(config::largest_policy_input(robot)) {
  for (const config::Sensor& sensor : robot.sensors) is_image_.push_back(sensor.image.has_value());
  header_.policy_hash = policy_hash;
  header_.by_client = 1;
}

void ShownEvidence::add_term(std::uint32_t kind, std::size_t sensor, const SampleQueue* queue) {
  header_.quantities = static_cast<std::uint8_t>(header_.quantities | quantity_of(kind));
  if (quantity_of(kind) != 0) {
    header_.joint_count = joints_;
    return;
  }
  auto at = std::ranges::lower_bound(sensors_, sensor, {}, &ShownSensor::sensor);
  if (at == sensors_.end() || at->sensor != sensor) at = sensors_.insert(at, {sensor, false, nullptr});
  if (queue != nullptr)
    at->queue = queue;
  else
    at->newest = true;
}

std::size_t ShownEvidence::sample_count() const {
  std::size_t count = 0;
  for (const ShownSensor& shown : sensors_)
    count += (shown.newest ? 1 : 0) + (shown.queue != nullptr ? shown.queue->shown().size() : 0);
  return count;
}

void ShownEvidence::put_samples(PolicyInputPacker& packer, std::span<const SensorSample> samples) const {
  for (const auto& [sensor, newest, queue] : sensors_) {
    if (queue != nullptr)
      for (const SensorSample& sample : queue->shown()) put_sample(packer, sample, sensor, false);
    if (newest) put_sample(packer, samples[sensor], sensor, is_image_[sensor]);
  }
}

void ShownEvidence::put_values(PolicyInputPacker& packer, const Observation& shown,
                               std::span<const SensorSample> samples) const {
  const std::pair<ShownQuantity, const float*> quantities[kShownQuantities] = {
      {ShownQuantity::q, shown.q.at.data()},
      {ShownQuantity::dq, shown.dq.at.data()},
      {ShownQuantity::tau, shown.tau.at.data()},
      {ShownQuantity::q_setpoint, shown.q_setpoint.at.data()},
      {ShownQuantity::dq_of_drive, shown.dq_of_drive.at.data()}};
  for (const auto& [quantity, values] : quantities)
    if ((header_.quantities & static_cast<unsigned>(quantity)) != 0) packer.put(std::span(values, header_.joint_count));
  for (const auto& [sensor, newest, queue] : sensors_) {
    if (queue != nullptr)
      for (const SensorSample& sample : queue->shown()) packer.put(values_in(sample));
    if (newest && !is_image_[sensor]) packer.put(values_in(samples[sensor]));
  }
}

void ShownEvidence::show(const Observation& shown, const takt_observation& view,
                         std::span<const SensorSample> samples) {
  header_.observation_id = view.id;
  header_.following = view.following;
  header_.committed_from = view.committed_from;
  header_.committed_count = view.committed_count;
  header_.sample_count = static_cast<std::uint32_t>(sample_count());
  header_.after_reset = view.reset != 0 ? 1 : 0;
  PolicyInputPacker packer(payload_);
  packer.put(std::span<const PolicyInputHeader>(&header_, 1));
  put_samples(packer, samples);
  put_values(packer, shown, samples);
  used_ = packer.packed().size();
}

std::span<const std::byte> ShownEvidence::answer(std::uint64_t sequence) {
  header_.sequence = sequence;
  ++header_.inference;
  std::memcpy(payload_.data(), &header_, sizeof header_);
  return std::span(payload_).first(used_);
}

}  // namespace takt::client
