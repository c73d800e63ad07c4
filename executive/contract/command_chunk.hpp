// SPDX-License-Identifier: Apache-2.0
// What a policy asks for: a short trajectory of joint targets that answers one observation.
//
// Only the used part travels: a header, then `value_count()` floats, packed step by step, and within a step field by
// field in the order of CommandField (fields absent from the mask take the robot's configured default: dq 0, kp and
// kd from the joint's gains, tau_ff 0). Units: q rad, dq rad/s, kp Nm/rad, kd Nm s/rad, tau_ff Nm.
//
// Step 0 is the target for the instant the answered observation was published (as the executive remembers it), step k
// for k * step_period later; between steps the executive plays what the robot's file declares (hold, linear, cubic);
// after the last step the chunk is spent.
//
// Everything in it is a claim by an untrusted process. Stamps may only make the command older.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "executive/contract/joints.hpp"
#include "executive/contract/layout.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt {

// Bits of CommandHeader::fields, in packing order.
enum class CommandField : std::uint8_t { q = 1, dq = 2, kp = 4, kd = 8, tau_ff = 16 };
inline constexpr std::uint8_t kAllCommandFields = 31;
inline constexpr std::size_t kCommandFieldCount = 5;

struct CommandHeader {
  std::uint64_t observation_id = 0;  // the observation answered
  std::uint64_t sequence = 0;        // strictly increasing within a session, from 1
  std::uint64_t policy_hash = 0;     // first 8 bytes of the policy file's SHA-256, big-endian
  MonoTime outside_sensed_at;        // oldest outside sensor sample used; unset when none was
  MonoTime dequeued_at;              // observation read by the host
  MonoTime infer_started_at;
  MonoTime infer_ended_at;
  MonoTime published_at;
  Duration step_period;                    // > 0
  std::uint32_t dropped_observations = 0;  // queued-up observations skipped since the previous command
  std::uint16_t step_count = 0;            // 1..kMaxChunkSteps
  std::uint16_t joint_count = 0;           // must equal the robot's
  std::uint8_t fields = 0;                 // mask of CommandField; q is mandatory
  std::uint8_t reserved[7] = {};
};
template <std::same_as<CommandHeader> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(observation_id),          TAKT_FIELD(sequence),     TAKT_FIELD(policy_hash),
      TAKT_FIELD(outside_sensed_at),       TAKT_FIELD(dequeued_at),  TAKT_FIELD(infer_started_at),
      TAKT_FIELD(infer_ended_at),          TAKT_FIELD(published_at), TAKT_FIELD(step_period),
      TAKT_FIELD(dropped_observations),    TAKT_FIELD(step_count),   TAKT_FIELD(joint_count),
      TAKT_FIELD_OF(CommandField, fields), TAKT_FIELD(reserved),
  };
}

static_assert(std::is_standard_layout_v<CommandHeader> && std::is_trivially_copyable_v<CommandHeader>);
static_assert(sizeof(CommandHeader) == 88);

constexpr std::size_t field_count(std::uint8_t fields) {
  return static_cast<std::size_t>(std::popcount(static_cast<unsigned>(fields & kAllCommandFields)));
}

// Positions of 128 steps for every joint, or all five fields of 64 steps.
inline constexpr std::size_t kMaxChunkValues = 20'480;

// Bytes of the largest chunk that is legal for a robot whose policies send `step_count` steps; 0: any number of them.
constexpr std::size_t largest_command_bytes(std::size_t joint_count, std::size_t step_count) {
  const std::size_t steps = step_count == 0 ? kMaxChunkSteps : step_count;
  return sizeof(CommandHeader) + 4 * std::min(joint_count * steps * kCommandFieldCount, kMaxChunkValues);
}

struct CommandChunk {
  CommandHeader header;
  float values[kMaxChunkValues] = {};

  [[nodiscard]] constexpr std::size_t value_count() const {
    return std::size_t{header.step_count} * header.joint_count * field_count(header.fields);
  }
  // Bytes of the used part: header and values. Meaningful once the header's counts were checked against capacity.
  [[nodiscard]] constexpr std::size_t used_bytes() const { return sizeof(CommandHeader) + 4 * value_count(); }
};
template <std::same_as<CommandChunk> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(header),
      TAKT_FIELD(values),
  };
}
static_assert(std::is_standard_layout_v<CommandChunk> && sizeof(CommandChunk) == 88 + 4 * kMaxChunkValues);

// Index into CommandChunk::values. Precondition: `field` is in the mask, step and joint are below their counts.
constexpr std::size_t value_index(const CommandHeader& header, CommandField field, std::size_t step,
                                  std::size_t joint) {
  const auto bits_before = static_cast<std::uint8_t>(static_cast<unsigned>(field) - 1U);
  const std::size_t rank = field_count(static_cast<std::uint8_t>(header.fields & bits_before));
  return (step * field_count(header.fields) + rank) * header.joint_count + joint;
}

}  // namespace takt
