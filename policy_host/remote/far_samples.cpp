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
    for (Kept& kept : source.kept)
      kept.bytes.resize(sensor.image ? sensor.image->bytes() : sizeof(float) * sensor.values);
  }
  return samples;
}

FarSamples::Source* FarSamples::find(std::uint32_t index) {
  const auto found = std::ranges::find(sources_, index, &Source::index);
  return found == sources_.end() ? nullptr : &*found;
}

const FarSamples::Kept* FarSamples::kept_of(const Source& source, const PeerId& sender) {
  const auto* const found = std::ranges::find(source.kept, sender, &Kept::sender);
  return found == source.kept.end() ? nullptr : found;
}

void FarSamples::take(const takt_remote_Sample& message, const PeerId& sender) {
  Source* const source = find(message.sensor);
  if (source == nullptr) return;
  const bool is_image = source->sensor->image.has_value();
  const void* const data = is_image ? static_cast<const void*>(message.image._buffer) : message.values._buffer;
  const std::size_t bytes =
      is_image ? std::size_t{message.image._length} : sizeof(float) * std::size_t{message.values._length};
  const auto same = std::ranges::find(source->kept, sender, &Kept::sender);
  const bool first_is_robots = robot_.is_known() && source->kept[0].sender == robot_;
  Kept& kept = same != source->kept.end() ? *same : source->kept[first_is_robots ? 1 : 0];
  if (bytes != kept.bytes.size()) return;
  std::memcpy(kept.bytes.data(), data, bytes);
  kept.sender = sender;
  kept.epoch = message.epoch;
  kept.sequence = message.number;
}

MonoTime FarSamples::oldest_sensed_at() const {
  MonoTime oldest;
  for (const Source& source : sources_)
    if (source.sensed_at.is_set() && (!oldest.is_set() || source.sensed_at < oldest)) oldest = source.sensed_at;
  return oldest;
}

void FarSamples::publish(Source& source, const Kept& kept, MonoTime sensed_at) {
  source.sensed_at = sensed_at;
  const MonoTime now = monotonic_now();
  const std::uint64_t sequence = ++source.published;
  if (source.sensor->image) {
    const std::span<std::byte> slot = source.server->begin();
    const ImageHeader header{sequence, sensed_at, now, static_cast<std::uint32_t>(kept.bytes.size()), 0};
    std::memcpy(slot.data(), &header, sizeof header);
    std::ranges::copy(kept.bytes, slot.subspan(sizeof header).begin());
    source.server->commit(sizeof header + kept.bytes.size());
    return;
  }
  SensorSample sample;
  sample.sequence = sequence;
  sample.sensed_at = sensed_at;
  sample.published_at = now;
  sample.value_count = source.sensor->values;
  std::memcpy(sample.values, kept.bytes.data(), kept.bytes.size());
  source.server->publish(sample);
}

bool FarSamples::pass_on(const takt_remote_Observation& message, const PeerId& sender, MonoTime arrived_at) {
  robot_ = sender;
  const std::span named(message.samples._buffer, message.samples._length);
  const auto has = [&](const takt_remote_SampleReference& one) {
    const Source* const source = find(one.sensor);
    const Kept* const kept = source == nullptr ? nullptr : kept_of(*source, sender);
    const bool is_kept = kept != nullptr && kept->epoch == message.epoch && kept->sequence == one.number;
    return is_kept && one.number != 0 && one.age_ns >= 0;  // 0: none came yet
  };
  if (!std::ranges::all_of(named, has)) return false;
  for (const takt_remote_SampleReference& one : named) {
    Source& source = *find(one.sensor);
    if (source.passed_epoch == message.epoch && source.passed_sequence == one.number) continue;
    publish(source, *kept_of(source, sender), MonoTime{std::max<std::int64_t>(arrived_at.ns - one.age_ns, 1)});
    source.passed_epoch = message.epoch;
    source.passed_sequence = one.number;
  }
  return true;
}

}  // namespace takt::policy_host::remote
