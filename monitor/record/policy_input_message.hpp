// SPDX-License-Identifier: Apache-2.0
// /takt/policy_input (takt_msgs/msg/PolicyInput): what a policy was shown for an answer and what its network said, as
// its process published it (executive/contract/policy_input.hpp). In the file it stands behind the newest tick that was
// recorded when it was read, near its command but in no fixed order with it; observation_id and sequence name that.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "executive/contract/policy_input.hpp"
#include "executive/contract/tick_record.hpp"
#include "monitor/record/bytes.hpp"
#include "monitor/record/cdr.hpp"

namespace takt::monitor {

struct PolicyInput {
  PolicyInputHeader header;  // its counts and quantities are those of the vectors
  std::vector<PolicyInputSample> samples;
  std::array<std::vector<float>, kShownQuantities> joints;  // by ShownQuantity; not shown: empty
  std::vector<float> sample_values, input, output;

  [[nodiscard]] const std::vector<float>& q() const { return joints[0]; }
};

// Nothing: no payload as policy_input.hpp describes it.
std::optional<PolicyInput> read_policy_input(std::span<const std::byte> payload);
Bytes packed(const PolicyInput& input);

struct RecordedPolicyInput {
  Player sender = Player::policy;  // or fallback: by the ring it came from
  PolicyInput input;
  std::uint32_t crc = 0;  // crc_of() when it was recorded
};
std::uint32_t crc_of(const PolicyInput& input);

extern const std::string_view kPolicyInputSchema;
void encode_policy_input(const RecordedPolicyInput& recorded, CdrWriter& out);
bool decode_policy_input(std::span<const std::byte> message, RecordedPolicyInput& out);

}  // namespace takt::monitor
