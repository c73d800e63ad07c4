// SPDX-License-Identifier: Apache-2.0
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
#include "executive/contract/image_sample.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/policy_input.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::ipc {

inline constexpr std::size_t kObservationDescriptor = 0;
inline constexpr std::size_t kCommandDescriptor = 1;
inline constexpr std::size_t kInputDescriptor = 2;

inline constexpr std::size_t kTickRingDescriptor = 0;
inline constexpr std::size_t kCommandRingDescriptor = 1;
inline constexpr std::size_t kKeyframeRingDescriptor = 2;
inline constexpr std::size_t kFrameRingDescriptor = 3;

inline constexpr std::uint32_t kTickRingSlots = 8192;
inline constexpr std::uint32_t kMaxKeyframeBytes = 500 * 1024;

RingShape observation_mailbox();
RingShape command_mailbox();
// Twice the longest queue: who reads every sample (`sensors[].queue`) may come late by as many.
RingShape sensor_mailbox();
// Half as many slots: an image is large, and cameras are slow.
RingShape image_mailbox(std::uint32_t height, std::uint32_t width, std::uint32_t channels);

// At 1 kHz: 8 s of ticks, 128 or more commands (8 s of one per tick where they are small), 8 keyframes, 2.7 s of frames
// at 24 per tick.
RingShape tick_ring(std::size_t joint_count);
// `largest_command`: bytes, largest_command_bytes() of the robot.
RingShape command_ring(std::size_t largest_command = sizeof(CommandChunk));
// `largest_input`: bytes, config::largest_policy_input() of the robot. Of what fits into about 2 MiB, 4 to 2048: at 50
// Hz and 100 values more than half a minute, and never less than several of a reader's rounds.
RingShape policy_input_ring(std::size_t largest_input);
RingShape keyframe_ring();
RingShape frame_ring();

}  // namespace takt::ipc
