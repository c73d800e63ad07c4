// SPDX-License-Identifier: Apache-2.0
#include "policy_host/sensor_link.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <utility>

#include "executive/contract/image_sample.hpp"
#include "executive/ipc/executive_segments.hpp"

namespace takt::policy_host {
namespace {

constexpr std::chrono::milliseconds kSensorAttachTimeout{100};
constexpr Duration kRetry = milliseconds(500);

}  // namespace

SensorLink::SensorLink(std::string socket, const Hello& hello, const ipc::RingShape& shape)
    : socket_(std::move(socket)), hello_(hello), shape_(shape) {}

void SensorLink::attach() {
  auto lease = ipc::attach(socket_, hello_, kSensorAttachTimeout);
  if (!lease) {
    problem_ = lease.error();
    return;
  }
  if (lease->descriptors.empty()) {
    problem_ = socket_ + ": the sensor handed out no mailbox";
    return;
  }
  auto segment = ipc::Segment::adopt_read_only(lease->descriptors[0].release(), ipc::ring_bytes(shape_));
  if (!segment) {
    problem_ = segment.error();
    return;
  }
  auto reader = ipc::SlotReader::attach(segment->readable(), shape_);
  if (!reader) {
    problem_ = reader.error();
    return;
  }
  attached_.emplace(std::move(*lease), std::move(*segment), std::move(*reader));
  problem_.clear();
  ++sessions_;
}

void SensorLink::stay_attached(MonoTime now) {
  if (attached_ && ipc::is_over(attached_->lease)) {
    attached_.reset();
    problem_ = socket_ + ": the sensor's process went away";
  }
  if (!attached_ && now >= next_attempt_) {
    next_attempt_ = now + kRetry;
    attach();
  }
}

ipc::ReadStatus SensorLink::read(MonoTime now, std::span<std::byte> newest) {
  stay_attached(now);
  if (!attached_) return ipc::ReadStatus::nothing_new;
  const ipc::ReadResult result = attached_->reader.read_latest(newest);
  // Behind what is shorter, an older sample's bytes would be left.
  const bool is_whole = result.status != ipc::ReadStatus::fresh || result.size == newest.size();
  return is_whole ? result.status : ipc::ReadStatus::corrupt;
}

ipc::ReadResult SensorLink::next(std::span<std::byte> sample) {
  return attached_ ? attached_->reader.read_next(sample) : ipc::ReadResult{};
}

void SensorLink::update(MonoTime now, SensorSample& sample) {
  SensorSample newest;
  if (read(now, std::as_writable_bytes(std::span(&newest, 1))) == ipc::ReadStatus::fresh) sample = newest;
}

void SensorLink::update(MonoTime now, SensorSample& sample, std::span<std::byte> image) {
  const ipc::ReadStatus status = read(now, image);
  if (status == ipc::ReadStatus::nothing_new) return;
  ImageHeader header;
  if (status == ipc::ReadStatus::fresh) std::memcpy(&header, image.data(), sizeof header);
  if (header.bytes != image.size() - sizeof header) header = {};
  sample.sequence = header.sequence;
  sample.sensed_at = header.sensed_at;
  sample.published_at = header.published_at;
}

std::vector<std::size_t> sensors_in_use(const config::RobotConfig& robot) {
  std::vector<std::size_t> in_use;
  for (std::size_t i = 0; i < robot.sensors.size(); ++i) {
    const auto uses = [&](const config::ObservationTerm& term) { return term.sensor == robot.sensors[i].name; };
    if (std::ranges::any_of(robot.policy->observation, uses)) in_use.push_back(i);
  }
  return in_use;
}

ipc::RingShape mailbox_of(const config::Sensor& sensor) {
  if (!sensor.image) return ipc::sensor_mailbox();
  return ipc::image_mailbox(sensor.image->height, sensor.image->width, sensor.image->channels);
}

std::size_t image_bytes(const config::Sensor& sensor) {
  return sensor.image ? sizeof(ImageHeader) + sensor.image->bytes() : 0;
}

SampleVerdict judge(const config::Sensor& sensor, const SensorSample& sample, MonoTime now) {
  const SampleVerdict stamps =
      judge_stamps({sample.sequence, sample.sensed_at, sample.published_at}, now, sensor.timeout);
  if (stamps == SampleVerdict::none_yet || sensor.image) return stamps;
  if (sample.value_count != sensor.values) return SampleVerdict::wrong_width;
  const std::span values(sample.values, sensor.values);
  if (!all_finite(values)) return SampleVerdict::not_finite;
  for (std::size_t i = 0; sensor.command && i < values.size(); ++i)
    if (values[i] < sensor.command->minimum[i] || values[i] > sensor.command->maximum[i])
      return SampleVerdict::out_of_limits;
  return stamps;
}

std::string sentence_of(SampleVerdict verdict, const config::RobotConfig& robot, const config::Sensor& sensor) {
  switch (verdict) {
    case SampleVerdict::usable:
      return {};
    case SampleVerdict::none_yet:
      return fmt::format("sensor {}: no sample yet", sensor.name);
    case SampleVerdict::wrong_width:
      return fmt::format("sensor {}: its sample has another number of values than the {} that {} lists", sensor.name,
                         sensor.values, robot.file);
    case SampleVerdict::from_future:
      return fmt::format("sensor {}: its newest sample is stamped after now; stamps are ns of CLOCK_MONOTONIC",
                         sensor.name);
    case SampleVerdict::not_finite:
      return fmt::format("sensor {}: its newest sample has values that are no numbers", sensor.name);
    case SampleVerdict::out_of_limits:
      return fmt::format("sensor {}: its newest sample is outside the limits of its `command` in {}", sensor.name,
                         robot.file);
    case SampleVerdict::too_old:
      return fmt::format("sensor {}: its newest sample is older than {:.0f} ms", sensor.name,
                         sensor.timeout.milliseconds());
  }
  return {};
}

namespace {

SensorSample absent(const config::CommandLimits& limits, MonoTime now) {
  SensorSample sample;
  sample.sequence = kAbsentSequence;
  sample.sensed_at = sample.published_at = now;
  sample.value_count = static_cast<std::uint32_t>(limits.when_absent.size());
  std::ranges::transform(limits.when_absent, sample.values, [](double value) { return static_cast<float>(value); });
  return sample;
}

}  // namespace

std::string take_usable(const config::RobotConfig& robot, std::span<const std::size_t> in_use,
                        std::span<const SensorSample> seen, MonoTime now, std::span<SensorSample> used) {
  for (const std::size_t i : in_use) {
    const config::Sensor& sensor = robot.sensors[i];
    used[i] = seen[i];
    const SampleVerdict verdict = judge(sensor, seen[i], now);
    if (verdict == SampleVerdict::usable) continue;
    if (!sensor.command) return sentence_of(verdict, robot, sensor);
    used[i] = absent(*sensor.command, now);
  }
  return {};
}

}  // namespace takt::policy_host
