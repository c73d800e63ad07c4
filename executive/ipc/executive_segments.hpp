// Which segments the executive hands to which role, in descriptor order, and the shape of each ring.
//
//   policy, fallback policy, candidate policy: [0] observation mailbox (read-only)   [1] command mailbox of its own
//   (writable, until sealed)   [2] input ring of its own (likewise), where the robot's policy inputs are recorded
//   monitor, viewer: [0] tick records  [1] accepted and refused commands  [2] keyframes  [3] CAN frames   (all
//   read-only)
//   input reader, fallback input reader, candidate input reader: [0] the input ring of that policy, for one session of
//   it (read-only)
#pragma once

#include <cstddef>
#include <cstdint>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/contract_layout.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/policy_input.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::ipc {

inline constexpr std::size_t kObservationDescriptor = 0;
inline constexpr std::size_t kCommandDescriptor = 1;
inline constexpr std::size_t kInputDescriptor = 2;

inline constexpr std::size_t kTickRingDescriptor = 0;
inline constexpr std::size_t kCommandRingDescriptor = 1;
inline constexpr std::size_t kKeyframeRingDescriptor = 2;
inline constexpr std::size_t kFrameRingDescriptor = 3;

inline constexpr std::uint32_t kMaxKeyframeBytes = 1000 * 1024;

constexpr RingShape observation_mailbox() {
  return {kMailboxSlots, sizeof(Observation), kObservationLayout};
}
constexpr RingShape command_mailbox() {
  return {kMailboxSlots, sizeof(CommandChunk), kCommandLayout};
}
// Twice the longest queue: who reads every sample (`sensors[].queue`) may come late by as many.
constexpr RingShape sensor_mailbox() {
  return {2 * kMaxSensorQueue, sizeof(SensorSample), kSensorSampleLayout};
}

// Half as many slots: an image is large, and cameras are slow.
constexpr RingShape image_mailbox(std::uint32_t height, std::uint32_t width, std::uint32_t channels) {
  return {kMailboxSlots / 2, static_cast<std::uint32_t>(sizeof(ImageHeader)) + height * width * channels,
          image_layout(height, width, channels)};
}

// Of what the largest chunk leaves room for in about 16 MiB: 128 to 8192 messages.
constexpr std::uint32_t command_slots(std::size_t slot_bytes) {
  std::uint32_t slots = 8192;
  while (slots > 128 && slots * slot_bytes > (std::size_t{16} << 20U)) slots /= 2;
  return slots;
}

// At 1 kHz: 8 s of ticks, 128 or more commands (8 s of one per tick where they are small), 8 keyframes, 2.7 s of frames
// at 24 per tick.
constexpr RingShape tick_ring(std::size_t joint_count) {
  return {8192, static_cast<std::uint32_t>(TickRecord::used_bytes(joint_count)), kTickRecordLayout};
}
// `largest_command`: bytes, largest_command_bytes() of the robot.
constexpr RingShape command_ring(std::size_t largest_command = sizeof(CommandChunk)) {
  const std::size_t bytes = sizeof(CommandTag) + largest_command;
  return {command_slots(bytes), static_cast<std::uint32_t>(bytes), kCommandLayout};
}
// `largest_input`: bytes, config::largest_policy_input() of the robot. Of what fits into about 2 MiB, 4 to 2048: at 50
// Hz and 100 values more than half a minute, and never less than several of a reader's rounds.
constexpr RingShape policy_input_ring(std::size_t largest_input) {
  std::uint32_t slots = 2048;
  while (slots > 4 && slots * largest_input > (std::size_t{2} << 20U)) slots /= 2;
  return {slots, static_cast<std::uint32_t>(largest_input), kPolicyInputLayout};
}
constexpr RingShape keyframe_ring() {
  return {8, kMaxKeyframeBytes, kTickRecordLayout};
}
constexpr RingShape frame_ring() {
  return {65536, sizeof(FrameRecord), kTickRecordLayout};
}

}  // namespace takt::ipc
