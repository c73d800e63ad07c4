// SPDX-License-Identifier: Apache-2.0
#include "policy_host/remote/far_samples.hpp"

#include <algorithm>
#include <cstring>
#include <span>

#include "config/paths.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::policy_host::remote {

std::expected<FarSamples, std::string> FarSamples::open(const config::RobotConfig& robot,
                                                        const std::string& runtime_directory,
                                                        std::optional<uid_t> policy_user) {
  FarSamples samples;
  for (const std::size_t index : sensors_in_use(robot)) {
    const config::Sensor& sensor = robot.sensors[index];
    auto server = ipc::SensorServer::start(config::sensor_socket(runtime_directory, sensor.name), policy_user,
                                           mailbox_of(sensor));
    if (!server) return std::unexpected(server.error());
    Source& source = samples.sources_.emplace_back();
    source.sensor = &sensor;
    source.index = static_cast<std::uint32_t>(index);
    source.server = std::move(*server);
    source.kept.resize(sensor.image ? sensor.image->bytes() : sizeof(float) * sensor.values);
  }
  return samples;
}

FarSamples::Source* FarSamples::find(std::uint32_t index) {
  const auto found = std::ranges::find(sources_, index, &Source::index);
  return found == sources_.end() ? nullptr : &*found;
}

void FarSamples::take(const takt_remote_Sample& message) {
  Source* const source = find(message.sensor);
  if (source == nullptr) return;
  const bool is_image = source->sensor->image.has_value();
  const void* const data = is_image ? static_cast<const void*>(message.image._buffer) : message.values._buffer;
  const std::size_t bytes =
      is_image ? std::size_t{message.image._length} : sizeof(float) * std::size_t{message.values._length};
  if (bytes != source->kept.size()) return;
  std::memcpy(source->kept.data(), data, bytes);
  source->epoch = message.epoch;
  source->sequence = message.number;
}

MonoTime FarSamples::oldest_sensed_at() const {
  MonoTime oldest;
  for (const Source& source : sources_)
    if (source.sensed_at.is_set() && (!oldest.is_set() || source.sensed_at < oldest)) oldest = source.sensed_at;
  return oldest;
}

void FarSamples::publish(Source& source, MonoTime sensed_at) {
  source.sensed_at = sensed_at;
  const MonoTime now = monotonic_now();
  const std::uint64_t sequence = ++source.published;
  if (source.sensor->image) {
    const std::span<std::byte> slot = source.server->begin();
    const ImageHeader header{sequence, sensed_at, now, static_cast<std::uint32_t>(source.kept.size()), 0};
    std::memcpy(slot.data(), &header, sizeof header);
    std::ranges::copy(source.kept, slot.subspan(sizeof header).begin());
    source.server->commit(sizeof header + source.kept.size());
    return;
  }
  SensorSample sample;
  sample.sequence = sequence;
  sample.sensed_at = sensed_at;
  sample.published_at = now;
  sample.value_count = source.sensor->values;
  std::memcpy(sample.values, source.kept.data(), source.kept.size());
  source.server->publish(sample);
}

bool FarSamples::pass_on(const takt_remote_Observation& message, MonoTime arrived_at) {
  const std::span named(message.samples._buffer, message.samples._length);
  const auto has = [&](const takt_remote_SampleReference& one) {
    const Source* const source = find(one.sensor);
    return source != nullptr && source->epoch == message.epoch && source->sequence == one.number && one.age_ns >= 0;
  };
  if (!std::ranges::all_of(named, has)) return false;
  for (const takt_remote_SampleReference& one : named) {
    Source& source = *find(one.sensor);
    if (source.passed_epoch == message.epoch && source.passed_sequence == one.number) continue;
    publish(source, MonoTime{std::max<std::int64_t>(arrived_at.ns - one.age_ns, 1)});
    source.passed_epoch = message.epoch;
    source.passed_sequence = one.number;
  }
  return true;
}

}  // namespace takt::policy_host::remote
