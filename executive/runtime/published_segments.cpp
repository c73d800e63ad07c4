// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/published_segments.hpp"

#include <utility>

#include "executive/ipc/executive_segments.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::runtime {
namespace {

template <class Value>
std::span<const std::byte> bytes_of(const Value& value) noexcept {
  return std::as_bytes(std::span(&value, 1));
}

}  // namespace

// The tick lets a recorder be behind by what the ring holds twice.
static_assert(ipc::kTickRingSlots >= 2 * pipeline::kLongestUnrecorded);

std::expected<PublishedSegments::Ring, std::string> PublishedSegments::make(const char* name,
                                                                            const ipc::RingShape& shape) {
  auto segment = ipc::Segment::create(name, ipc::ring_bytes(shape), true);
  if (!segment) return std::unexpected(segment.error());
  if (auto sealed = segment->seal_against_new_writers(); !sealed) return std::unexpected(sealed.error());
  ipc::SlotWriter writer(segment->writable(), shape);
  return Ring{std::move(*segment), writer};
}

std::expected<PublishedSegments, std::string> PublishedSegments::create(std::size_t joint_count,
                                                                        std::size_t largest_command) {
  auto observations = make("takt-observation", ipc::observation_mailbox());
  if (!observations) return std::unexpected(observations.error());
  auto ticks = make("takt-ticks", ipc::tick_ring(joint_count));
  if (!ticks) return std::unexpected(ticks.error());
  auto commands = make("takt-commands", ipc::command_ring(largest_command));
  if (!commands) return std::unexpected(commands.error());
  auto keyframes = make("takt-keyframes", ipc::keyframe_ring());
  if (!keyframes) return std::unexpected(keyframes.error());
  auto frames = make("takt-frames", ipc::frame_ring());
  if (!frames) return std::unexpected(frames.error());
  return PublishedSegments(joint_count, std::move(*observations), std::move(*ticks), std::move(*commands),
                           std::move(*keyframes), std::move(*frames));
}

PublishedSegments::PublishedSegments(std::size_t joint_count, Ring observations, Ring ticks, Ring commands,
                                     Ring keyframes, Ring frames)
    : joint_count_(joint_count),
      observations_(std::move(observations)),
      ticks_(std::move(ticks)),
      commands_(std::move(commands)),
      keyframes_(std::move(keyframes)),
      frames_(std::move(frames)) {}

void PublishedSegments::observation(const Observation& observation) noexcept {
  observations_.writer.publish(bytes_of(observation));
}

void PublishedSegments::tick(const TickRecord& record) noexcept {
  ticks_.writer.publish(bytes_of(record).first(TickRecord::used_bytes(joint_count_)));
}

void PublishedSegments::command(const CommandTag& tag, std::span<const std::byte> kept) noexcept {
  commands_.writer.publish(bytes_of(tag), kept);
}

void PublishedSegments::keyframe(std::uint64_t tick, std::span<const std::byte> state) noexcept {
  keyframes_.writer.publish(bytes_of(TickTag{tick}), state);
}

void PublishedSegments::frame(const FrameRecord& frame) noexcept {
  frames_.writer.publish(bytes_of(frame));
}

std::vector<int> PublishedSegments::monitor_descriptors() const {
  return {ticks_.segment.fd(), commands_.segment.fd(), keyframes_.segment.fd(), frames_.segment.fd()};
}

ipc::SlotReader PublishedSegments::tick_reader() const {
  return ipc::SlotReader::attach(ticks_.segment.readable(), ipc::tick_ring(joint_count_)).value();
}

ipc::SlotReader PublishedSegments::frame_reader() const {
  return ipc::SlotReader::attach(frames_.segment.readable(), ipc::frame_ring()).value();
}

}  // namespace takt::runtime
