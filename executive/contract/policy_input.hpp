// What a policy's network was shown for one observation, and what it said: published by the policy's host beside its
// command, into a ring that only a recorder reads. Evidence, never an input of a decision.
//
// A payload is a PolicyInputHeader, then sensor_count PolicyInputSamples, then float32 values without gaps:
//   joint_count   q, the positions in the answered observation, rad
//   ...           the values of each sample, in their order, SI units
//   input_count   the network's input tensors one after the other, as it was given them: scaled, history included
//   output_count  its raw actions, before scale and offset, step after step
//
// Everything in it is a claim by an untrusted process. Thread rule: plain values, copied whole.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "executive/contract/layout.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt {

struct PolicyInputHeader {
  std::uint64_t observation_id = 0;  // the observation answered
  std::uint64_t sequence = 0;        // of the command that answers it, within its session
  std::uint64_t inference = 0;       // 1, 2, 3, ... in the life of the host: a gap was not recorded
  std::uint64_t policy_hash = 0;     // as in CommandHeader
  std::uint32_t joint_count = 0;
  std::uint32_t sensor_count = 0;  // samples that went into the input
  std::uint32_t input_count = 0;
  std::uint32_t output_count = 0;
  std::uint8_t after_reset = 0;  // 1: the policy had forgotten its past, hidden state included, before this inference
  std::uint8_t built_in = 0;     // 1: inferred by the built-in engine, which gives the same bits again
  std::uint8_t reserved[6] = {};
};

struct PolicyInputSample {
  std::uint64_t sequence = 0;  // UINT64_MAX: nobody spoke, and a command's when_absent stood in
  MonoTime sensed_at;
  MonoTime published_at;
  std::uint32_t sensor = 0;  // index into the robot file's sensors
  std::uint32_t value_count = 0;
};

#define TAKT_POLICY_INPUT_FIELDS                                                                 \
  {                                                                                              \
    TAKT_FIELD(PolicyInputHeader, observation_id), TAKT_FIELD(PolicyInputHeader, sequence),      \
        TAKT_FIELD(PolicyInputHeader, inference), TAKT_FIELD(PolicyInputHeader, policy_hash),    \
        TAKT_FIELD(PolicyInputHeader, joint_count), TAKT_FIELD(PolicyInputHeader, sensor_count), \
        TAKT_FIELD(PolicyInputHeader, input_count), TAKT_FIELD(PolicyInputHeader, output_count), \
        TAKT_FIELD(PolicyInputHeader, after_reset), TAKT_FIELD(PolicyInputHeader, built_in),     \
        TAKT_FIELD(PolicyInputHeader, reserved)                                                  \
  }
#define TAKT_POLICY_INPUT_SAMPLE_FIELDS                                                     \
  {                                                                                         \
    TAKT_FIELD(PolicyInputSample, sequence), TAKT_FIELD(PolicyInputSample, sensed_at),      \
        TAKT_FIELD(PolicyInputSample, published_at), TAKT_FIELD(PolicyInputSample, sensor), \
        TAKT_FIELD(PolicyInputSample, value_count)                                          \
  }

static_assert(std::is_standard_layout_v<PolicyInputHeader> && std::is_trivially_copyable_v<PolicyInputHeader>);
static_assert(std::is_standard_layout_v<PolicyInputSample> && std::is_trivially_copyable_v<PolicyInputSample>);
static_assert(sizeof(PolicyInputHeader) == 56 && sizeof(PolicyInputSample) == 32);
static_assert(is_gapless(TAKT_POLICY_INPUT_FIELDS, sizeof(PolicyInputHeader)));
static_assert(is_gapless(TAKT_POLICY_INPUT_SAMPLE_FIELDS, sizeof(PolicyInputSample)));
inline constexpr std::uint64_t kPolicyInputLayout =
    layout_hash({{layout_hash(TAKT_POLICY_INPUT_FIELDS), layout_hash(TAKT_POLICY_INPUT_SAMPLE_FIELDS)}});
#undef TAKT_POLICY_INPUT_FIELDS
#undef TAKT_POLICY_INPUT_SAMPLE_FIELDS

// A payload may be this large, so that no robot file makes a ring of gigabytes.
inline constexpr std::size_t kMaxPolicyInputBytes = std::size_t{1} << 20U;

// `value_count`: floats of all kinds together.
constexpr std::size_t policy_input_bytes(std::size_t sensor_count, std::size_t value_count) {
  return sizeof(PolicyInputHeader) + sensor_count * sizeof(PolicyInputSample) + 4 * value_count;
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
