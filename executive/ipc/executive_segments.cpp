// SPDX-License-Identifier: Apache-2.0
#include "executive/ipc/executive_segments.hpp"

#include "executive/contract/contract_layout.hpp"

namespace takt::ipc {
namespace {

// Of what the largest chunk leaves room for in about 16 MiB: 128 to 8192 messages.
constexpr std::uint32_t command_slots(std::size_t slot_bytes) {
  std::uint32_t slots = 8192;
  while (slots > 128 && slots * slot_bytes > (std::size_t{16} << 20U)) slots /= 2;
  return slots;
}

}  // namespace

RingShape observation_mailbox() {
  return {kMailboxSlots, sizeof(Observation), layout_of<Observation>()};
}

RingShape command_mailbox() {
  return {kMailboxSlots, sizeof(CommandChunk), layout_of<CommandChunk>()};
}

RingShape sensor_mailbox() {
  return {2 * kMaxSensorQueue, sizeof(SensorSample), layout_of<SensorSample>()};
}

RingShape image_mailbox(std::uint32_t height, std::uint32_t width, std::uint32_t channels) {
  return {kMailboxSlots / 2, static_cast<std::uint32_t>(sizeof(ImageHeader)) + height * width * channels,
          image_layout(height, width, channels)};
}

RingShape tick_ring(std::size_t joint_count) {
  return {kTickRingSlots, static_cast<std::uint32_t>(TickRecord::used_bytes(joint_count)), layout_of<TickRecord>()};
}

RingShape command_ring(std::size_t largest_command) {
  const std::size_t bytes = sizeof(CommandTag) + largest_command;
  return {command_slots(bytes), static_cast<std::uint32_t>(bytes),
          layout_hash({{layout_of<CommandTag>(), layout_of<CommandChunk>()}})};
}

RingShape policy_input_ring(std::size_t largest_input) {
  std::uint32_t slots = 2048;
  while (slots > 4 && slots * largest_input > (std::size_t{2} << 20U)) slots /= 2;
  return {slots, static_cast<std::uint32_t>(largest_input),
          layout_hash({{layout_of<PolicyInputHeader>(), layout_of<PolicyInputSample>()}})};
}

RingShape keyframe_ring() {
  return {8, kMaxKeyframeBytes, layout_of<TickTag>()};
}

RingShape frame_ring() {
  return {65536, sizeof(FrameRecord), layout_of<FrameRecord>()};
}

}  // namespace takt::ipc
