// SPDX-License-Identifier: Apache-2.0
// What a policy was shown of one observation, and what its network said: published by the policy's process beside its
// command, into a ring that only a recorder reads. Evidence, never an input of a decision.
//
// Two kinds of processes publish it: a policy host, which knows its network's input and raw output, and libtakt-client,
// which knows what it handed out and not what became of it (by_client).
//
// A payload is a PolicyInputHeader, then sample_count PolicyInputSamples, then float32 values without gaps:
//   joint_count of each quantity in `quantities`, in the order of ShownQuantity; a host shows q alone, the positions in
//                 the answered observation
//   ...           the values of each sample, in their order, SI units
//   input_count   the network's input tensors one after the other, as it was given them: scaled, history included, but
//                 for what images filled
//   output_count  its raw actions, before scale and offset, step after step
// An image is a sample without values: the recorder takes its bytes from the sensor itself (monitor/record). A host's
// first samples are the images in its network's input, in the order in which they stand there, histories included; then
// comes each other sensor's newest sample. A client's samples stand in the order of the robot file's sensors, of a
// queue all that were handed out, oldest first.
//
// Everything in it is a claim by an untrusted process. Thread rule: plain values, copied whole.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "executive/contract/layout.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt {

// Bits of PolicyInputHeader::quantities: what of the joints was shown.
enum class ShownQuantity : std::uint8_t { q = 1, dq = 2, tau = 4, q_setpoint = 8, dq_of_drive = 16 };
inline constexpr std::size_t kShownQuantities = 5;

struct PolicyInputHeader {
  std::uint64_t observation_id = 0;  // the observation answered
  std::uint64_t sequence = 0;        // of the command that answers it, within its session
  std::uint64_t inference = 0;       // 1, 2, 3, ... in the life of the process: a gap was not recorded
  std::uint64_t policy_hash = 0;     // as in CommandHeader
  // Of this policy's own commands the one that the robot followed, 0: none, and which of its steps were promised.
  std::uint64_t following = 0;
  std::uint32_t committed_from = 0;
  std::uint32_t committed_count = 0;
  std::uint32_t joint_count = 0;
  std::uint32_t sample_count = 0;  // of outside sensors
  std::uint32_t input_count = 0;
  std::uint32_t output_count = 0;
  std::uint8_t after_reset = 0;  // 1: the policy had forgotten its past, hidden state included, or was told to
  std::uint8_t built_in = 0;     // 1: inferred by the built-in engine, which gives the same bits again
  std::uint8_t by_client = 0;    // 1: what libtakt-client handed out; input_count and output_count are 0
  std::uint8_t quantities = 0;   // of ShownQuantity
  std::uint8_t reserved[4] = {};
};
template <std::same_as<PolicyInputHeader> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(observation_id),  TAKT_FIELD(sequence),     TAKT_FIELD(inference),
      TAKT_FIELD(policy_hash),     TAKT_FIELD(following),    TAKT_FIELD(committed_from),
      TAKT_FIELD(committed_count), TAKT_FIELD(joint_count),  TAKT_FIELD(sample_count),
      TAKT_FIELD(input_count),     TAKT_FIELD(output_count), TAKT_FIELD(after_reset),
      TAKT_FIELD(built_in),        TAKT_FIELD(by_client),    TAKT_FIELD_OF(ShownQuantity, quantities),
      TAKT_FIELD(reserved),
  };
}

struct PolicyInputSample {
  std::uint64_t sequence = 0;  // UINT64_MAX: no command was given, its when_absent stood in
  MonoTime sensed_at;
  MonoTime published_at;
  std::uint32_t sensor = 0;       // index into the robot file's sensors
  std::uint32_t value_count = 0;  // 0: an image
};
template <std::same_as<PolicyInputSample> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(sequence), TAKT_FIELD(sensed_at),   TAKT_FIELD(published_at),
      TAKT_FIELD(sensor),   TAKT_FIELD(value_count),
  };
}

static_assert(std::is_standard_layout_v<PolicyInputHeader> && std::is_trivially_copyable_v<PolicyInputHeader>);
static_assert(std::is_standard_layout_v<PolicyInputSample> && std::is_trivially_copyable_v<PolicyInputSample>);
static_assert(sizeof(PolicyInputHeader) == 72 && sizeof(PolicyInputSample) == 32);

// Values of all joints that a payload begins with. Precondition: no other bits than ShownQuantity's.
constexpr std::size_t shown_joint_values(const PolicyInputHeader& header) {
  return static_cast<std::size_t>(std::popcount(header.quantities)) * header.joint_count;
}

// A payload may be this large, so that no robot file makes a ring of gigabytes.
inline constexpr std::size_t kMaxPolicyInputBytes = std::size_t{1} << 20U;

// `value_count`: floats of all kinds together.
constexpr std::size_t policy_input_bytes(std::size_t sample_count, std::size_t value_count) {
  return sizeof(PolicyInputHeader) + sample_count * sizeof(PolicyInputSample) + 4 * value_count;
}

// Appends the pieces of a payload to a buffer that has room for them, in the order above.
class PolicyInputPacker {
 public:
  explicit PolicyInputPacker(std::span<std::byte> to) : to_(to) {}
  template <class Value>
  void put(std::span<const Value> values) {
    static_assert(std::is_trivially_copyable_v<Value>);
    const auto bytes = std::as_bytes(values);
    std::ranges::copy(bytes, to_.begin() + static_cast<std::ptrdiff_t>(used_));
    used_ += bytes.size();
  }
  [[nodiscard]] std::span<const std::byte> packed() const { return to_.first(used_); }

 private:
  std::span<std::byte> to_;
  std::size_t used_ = 0;
};

}  // namespace takt
