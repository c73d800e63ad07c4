// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/policy_input_message.hpp"

#include <algorithm>
#include <cstring>
#include <numeric>

#include "executive/ipc/crc32c.hpp"

namespace takt::monitor {
namespace {

constexpr std::size_t kMostValues = kMaxPolicyInputBytes / 4;

// Takes pieces off the front of a payload; what is not there leaves it not whole.
class Unpacker {
 public:
  explicit Unpacker(std::span<const std::byte> payload) : rest_(payload) {}
  template <class Value>
  void take(Value* values, std::size_t count) {
    const std::size_t bytes = count * sizeof(Value);
    whole_ = whole_ && bytes <= rest_.size();
    if (!whole_ || bytes == 0) return;
    std::memcpy(values, rest_.data(), bytes);
    rest_ = rest_.subspan(bytes);
  }
  template <class Value>
  void take(std::vector<Value>& values, std::size_t count) {
    whole_ = whole_ && count <= rest_.size() / sizeof(Value);
    if (!whole_) return;
    values.resize(count);
    take(values.data(), count);
  }
  [[nodiscard]] bool is_whole_and_spent() const { return whole_ && rest_.empty(); }

 private:
  std::span<const std::byte> rest_;
  bool whole_ = true;
};

std::size_t values_of(const std::vector<PolicyInputSample>& samples) {
  return std::accumulate(samples.begin(), samples.end(), std::size_t{0},
                         [](std::size_t sum, const PolicyInputSample& sample) { return sum + sample.value_count; });
}

void put_floats(CdrWriter& out, const std::vector<float>& values) {
  out.put_count(values.size());
  for (const float value : values) out.put(value);
}

std::uint32_t get_floats(CdrReader& reader, std::vector<float>& values) {
  values.resize(reader.get_count(kMostValues));
  reader.get_column(values.data(), sizeof(float), sizeof(float), values.size());
  return static_cast<std::uint32_t>(values.size());
}

// Puts the header's word on the joints' values beside the vectors, as it was published. False: they differ in length.
bool count_joints(PolicyInput& input) {
  input.header.joint_count = 0;
  input.header.quantities = 0;
  for (std::size_t i = 0; i < kShownQuantities; ++i) {
    const std::size_t count = input.joints[i].size();
    if (count == 0) continue;
    if (input.header.joint_count != 0 && count != input.header.joint_count) return false;
    input.header.joint_count = static_cast<std::uint32_t>(count);
    input.header.quantities = static_cast<std::uint8_t>(input.header.quantities | (1U << i));
  }
  return true;
}

// One sequence per member of the samples, as columns.
template <class Member>
void put_column(CdrWriter& out, const std::vector<PolicyInputSample>& samples, Member PolicyInputSample::*member) {
  out.put_count(samples.size());
  for (const PolicyInputSample& sample : samples) out.put_raw(&(sample.*member), sizeof(Member));
}

template <class Member>
bool get_column(CdrReader& reader, std::vector<PolicyInputSample>& samples, Member PolicyInputSample::*member) {
  const std::size_t count = reader.get_count(kMostValues);
  if (samples.empty()) samples.resize(count);
  if (count != samples.size()) return false;
  for (PolicyInputSample& sample : samples) reader.get_raw(&(sample.*member), sizeof(Member));
  return true;
}

}  // namespace

const std::string_view kPolicyInputSchema =
    R"(# What a policy was shown for one observation, and what its network said. Claims of the policy's process.
uint64 observation_id         # answered
uint64 sequence               # of the command that answers it (Command's)
uint64 inference              # 1, 2, 3, ... in the life of the process; a gap was not recorded
uint64 policy_hash
uint64 following              # of this policy's own commands the one that the robot followed; 0: none
uint32 committed_from         # which of its steps were promised, from this one on
uint32 committed_count
float32[] q                   # of the joints in the answered observation, as far as it was shown: rad
float32[] dq                  # rad/s
float32[] tau                 # Nm
float32[] q_setpoint          # rad
float32[] dq_of_drive         # rad/s
float32[] input               # the network's input tensors, one after the other, as given: scaled, history included;
                              # without what images filled
float32[] output              # its raw actions, step after step
uint32[] sample_sensor        # outside samples that were shown: index into the robot file's sensors
uint64[] sample_sequence      # 18446744073709551615: nobody spoke, a command's when_absent stood in
int64[] sample_sensed_at      # ns, CLOCK_MONOTONIC
int64[] sample_published_at
uint32[] sample_value_count   # 0: an image, see Image
float32[] sample_values       # one sample after the other
uint8 after_reset             # 1: the policy had forgotten its past before this inference, or was told to
uint8 built_in                # 1: inferred by Takt's built-in engine
uint8 by_client               # 1: what libtakt-client handed out; input and output are the policy's own affair
uint8 sender                  # whose mailbox: 1 the policy, 2 the fallback policy, 3 the candidate
uint32 crc                    # CRC-32C of what the process published
)";

std::optional<PolicyInput> read_policy_input(std::span<const std::byte> payload) {
  PolicyInput input;
  PolicyInputHeader& header = input.header;
  Unpacker unpacker(payload);
  unpacker.take(&header, 1);
  // Nothing that would not come back from the file.
  if (header.quantities >> kShownQuantities != 0 || (header.quantities == 0) != (header.joint_count == 0))
    return std::nullopt;
  unpacker.take(input.samples, header.sample_count);
  for (std::size_t i = 0; i < kShownQuantities; ++i)
    if ((unsigned{header.quantities} >> i & 1U) != 0) unpacker.take(input.joints[i], header.joint_count);
  unpacker.take(input.sample_values, values_of(input.samples));
  unpacker.take(input.input, header.input_count);
  unpacker.take(input.output, header.output_count);
  const bool is_clean = std::ranges::all_of(header.reserved, [](std::uint8_t byte) { return byte == 0; });
  if (!unpacker.is_whole_and_spent() || !is_clean) return std::nullopt;
  return input;
}

Bytes packed(const PolicyInput& input) {
  std::size_t values = input.sample_values.size() + input.input.size() + input.output.size();
  for (const auto& quantity : input.joints) values += quantity.size();
  Bytes bytes(policy_input_bytes(input.samples.size(), values));
  PolicyInputPacker packer(bytes);
  packer.put(std::span(&input.header, 1));
  packer.put(std::span(input.samples));
  for (const auto& quantity : input.joints) packer.put(std::span(quantity));
  for (const auto* of : {&input.sample_values, &input.input, &input.output}) packer.put(std::span(*of));
  return bytes;
}

std::uint32_t crc_of(const PolicyInput& input) {
  return ipc::crc32c(packed(input));
}

void encode_policy_input(const RecordedPolicyInput& recorded, CdrWriter& out) {
  const PolicyInput& input = recorded.input;
  out.clear();
  out.put(input.header.observation_id);
  out.put(input.header.sequence);
  out.put(input.header.inference);
  out.put(input.header.policy_hash);
  out.put(input.header.following);
  out.put(input.header.committed_from);
  out.put(input.header.committed_count);
  for (const auto& quantity : input.joints) put_floats(out, quantity);
  put_floats(out, input.input);
  put_floats(out, input.output);
  put_column(out, input.samples, &PolicyInputSample::sensor);
  put_column(out, input.samples, &PolicyInputSample::sequence);
  put_column(out, input.samples, &PolicyInputSample::sensed_at);
  put_column(out, input.samples, &PolicyInputSample::published_at);
  put_column(out, input.samples, &PolicyInputSample::value_count);
  put_floats(out, input.sample_values);
  out.put(input.header.after_reset);
  out.put(input.header.built_in);
  out.put(input.header.by_client);
  out.put(static_cast<std::uint8_t>(recorded.sender));
  out.put(recorded.crc);
}

bool decode_policy_input(std::span<const std::byte> message, RecordedPolicyInput& out) {
  CdrReader reader(message);
  PolicyInput& input = out.input;
  input = {};
  input.header.observation_id = reader.get<std::uint64_t>();
  input.header.sequence = reader.get<std::uint64_t>();
  input.header.inference = reader.get<std::uint64_t>();
  input.header.policy_hash = reader.get<std::uint64_t>();
  input.header.following = reader.get<std::uint64_t>();
  input.header.committed_from = reader.get<std::uint32_t>();
  input.header.committed_count = reader.get<std::uint32_t>();
  for (auto& quantity : input.joints) get_floats(reader, quantity);
  input.header.input_count = get_floats(reader, input.input);
  input.header.output_count = get_floats(reader, input.output);
  const bool samples_agree = get_column(reader, input.samples, &PolicyInputSample::sensor) &&
                             get_column(reader, input.samples, &PolicyInputSample::sequence) &&
                             get_column(reader, input.samples, &PolicyInputSample::sensed_at) &&
                             get_column(reader, input.samples, &PolicyInputSample::published_at) &&
                             get_column(reader, input.samples, &PolicyInputSample::value_count);
  input.header.sample_count = static_cast<std::uint32_t>(input.samples.size());
  get_floats(reader, input.sample_values);
  input.header.after_reset = reader.get<std::uint8_t>();
  input.header.built_in = reader.get<std::uint8_t>();
  input.header.by_client = reader.get<std::uint8_t>();
  out.sender = static_cast<Player>(reader.get<std::uint8_t>());
  out.crc = reader.get<std::uint32_t>();
  if (out.sender == Player::none || static_cast<std::size_t>(out.sender) >= kPlayerCount) return false;
  return reader.ok() && samples_agree && count_joints(input) && values_of(input.samples) == input.sample_values.size();
}

}  // namespace takt::monitor
