// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/run_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "executive/ipc/crc32c.hpp"
#include "monitor/record/image_message.hpp"
#include "monitor/record/policy_input_message.hpp"
#include "monitor/record/standard_messages.hpp"
#include "monitor/record/tick_schema.hpp"

namespace takt::monitor {
namespace {

using enum FieldType;
constexpr FieldRole in = FieldRole::input;

#define HEADER(member) offsetof(CommandHeader, member)
constexpr TickField kCommandFields[] = {
    {"observation_id", u64, HEADER(observation_id), in, ""},
    {"sequence", u64, HEADER(sequence), in, ""},
    {"policy_hash", u64, HEADER(policy_hash), in, ""},
    {"outside_sensed_at", i64, HEADER(outside_sensed_at), in, ""},
    {"dequeued_at", i64, HEADER(dequeued_at), in, ""},
    {"infer_started_at", i64, HEADER(infer_started_at), in, ""},
    {"infer_ended_at", i64, HEADER(infer_ended_at), in, ""},
    {"published_at", i64, HEADER(published_at), in, ""},
    {"step_period", i64, HEADER(step_period), in, ""},
    {"dropped_observations", u32, HEADER(dropped_observations), in, ""},
    {"step_count", u16, HEADER(step_count), in, ""},
    {"joint_count", u16, HEADER(joint_count), in, ""},
    {"fields", u8, HEADER(fields), in, ""},
};
#undef HEADER
constexpr std::size_t kReservedAt = offsetof(CommandHeader, reserved);

constexpr std::string_view kCommandSchema =
    R"(# A policy's message as the executive read it, before any judgement; the verdict is in the tick's `arrival`.
uint64 tick
uint32 byte_count             # of the message; fewer than a header's when it was cut short; more than is here when
                              # it was refused and only its header was kept
uint64 observation_id
uint64 sequence
uint64 policy_hash
int64 outside_sensed_at       # ns, CLOCK_MONOTONIC, like all stamps; claims of the policy host
int64 dequeued_at
int64 infer_started_at
int64 infer_ended_at
int64 published_at
int64 step_period             # ns
uint32 dropped_observations
uint16 step_count
uint16 joint_count
uint8 fields                  # 1 q, 2 dq, 4 kp, 8 kd, 16 tau_ff
uint8[7] reserved
float32[] values              # step by step, within a step field by field
uint8[] rest                  # bytes that make no whole float
uint32 crc                    # CRC-32C of the message; with byte_count and whole_crc where only its header was kept
uint32 whole_crc              # CRC-32C of the whole message where only its header was kept; 0: never read whole
uint8 sender                  # 1 the policy in charge, 2 the fallback policy (Tick's fallback_arrival), 3 the candidate
)";

constexpr std::string_view kKeyframeSchema =
    "uint64 tick    # the state is the one after this tick\n"
    "uint8[] state  # opaque; see pipeline::save\n"
    "uint32 crc     # CRC-32C of the state\n";

constexpr std::string_view kTransitionSchema =
    "uint64 tick\n"
    "int64 now   # ns, CLOCK_MONOTONIC\n"
    "uint8 from  # Tick's MODE values\n"
    "uint8 to\n"
    "uint8 cause # Tick's CAUSE values\n"
    "string text\n";

constexpr std::string_view kLossSchema =
    "string ring         # tick, command, keyframe, frame, policy_input, fallback_input, candidate_input or image\n"
    "string reason       # overwritten, before_attach, unreadable, too_many or recording_stopped; of image what became "
    "of it\n"
    "uint64 count        # entries\n"
    "uint64 after_tick   # last tick recorded before the gap; 0 none\n"
    "uint64 before_tick  # first tick recorded after it; 0 none\n";

std::string place_in_command(std::size_t at) {
  if (at >= sizeof(CommandHeader)) return fmt::format("values[{}]", (at - sizeof(CommandHeader)) / 4);
  for (const TickField& field : kCommandFields) {
    if (at >= field.offset && at < field.offset + size_of(field.type)) return std::string(field.name);
  }
  return "reserved";
}

}  // namespace

std::string_view topic_name(Topic topic) {
  switch (topic) {
    case Topic::tick:
      return "/takt/tick";
    case Topic::command:
      return "/takt/command";
    case Topic::keyframe:
      return "/takt/keyframe";
    case Topic::transition:
      return "/takt/transition";
    case Topic::loss:
      return "/takt/loss";
    case Topic::joint_states:
      return "/joint_states";
    case Topic::diagnostics:
      return "/diagnostics";
    case Topic::log:
      return "/rosout";
    case Topic::policy_input:
      return "/takt/policy_input";
    case Topic::image:
      return "/takt/image";
    case Topic::robot_description:
      return "/robot_description";
    case Topic::transforms:
      return "/tf";
  }
  return "";
}

std::vector<McapTopic> run_topics() {
  const auto topic = [](Topic which, std::string_view schema_name, std::string schema) {
    return McapTopic{std::string(topic_name(which)), std::string(schema_name), std::move(schema)};
  };
  return {topic(Topic::tick, "takt_msgs/msg/Tick", tick_schema()),
          topic(Topic::command, "takt_msgs/msg/Command", std::string(kCommandSchema)),
          topic(Topic::keyframe, "takt_msgs/msg/Keyframe", std::string(kKeyframeSchema)),
          topic(Topic::transition, "takt_msgs/msg/Transition", std::string(kTransitionSchema)),
          topic(Topic::loss, "takt_msgs/msg/Loss", std::string(kLossSchema)),
          topic(Topic::joint_states, "sensor_msgs/msg/JointState", joint_state_schema()),
          topic(Topic::diagnostics, "diagnostic_msgs/msg/DiagnosticArray", diagnostic_array_schema()),
          topic(Topic::log, "rcl_interfaces/msg/Log", log_schema()),
          topic(Topic::policy_input, "takt_msgs/msg/PolicyInput", std::string(kPolicyInputSchema)),
          topic(Topic::image, "takt_msgs/msg/Image", std::string(kImageSchema)),
          topic(Topic::robot_description, "std_msgs/msg/String", string_schema()),
          topic(Topic::transforms, "tf2_msgs/msg/TFMessage", tf_message_schema())};
}

McapTopic picture_topic(std::string_view sensor) {
  return {fmt::format("/{}/compressed", sensor), "sensor_msgs/msg/CompressedImage", compressed_image_schema()};
}

std::optional<CommandHeader> header_of(const RecordedCommand& command) {
  CommandHeader header;
  if (command.payload.size() < sizeof header) return std::nullopt;
  std::memcpy(&header, command.payload.data(), sizeof header);
  return header;
}

std::optional<CommandHeader> policy_header_of(const RecordedCommand& command) {
  return command.sender == Player::policy ? header_of(command) : std::nullopt;
}

std::uint32_t crc_of(const RecordedCommand& command) {
  const std::uint32_t of_payload = ipc::crc32c(command.payload);
  if (command.cut_from == 0) return of_payload;
  const std::uint32_t rest[] = {command.cut_from, command.whole_crc};
  return ipc::crc32c(std::as_bytes(std::span(rest)), of_payload);
}

void encode_command(const RecordedCommand& command, CdrWriter& out) {
  std::byte header[sizeof(CommandHeader)] = {};
  std::copy_n(command.payload.begin(), std::min(command.payload.size(), sizeof header), header);
  out.clear();
  out.put(command.tick);
  out.put_count(command.cut_from != 0 ? command.cut_from : command.payload.size());
  for (const TickField& field : kCommandFields) out.put_raw(header + field.offset, size_of(field.type));
  for (std::size_t at = kReservedAt; at < sizeof header; ++at) out.put_raw(header + at, 1);
  const std::size_t behind = command.payload.size() - std::min(command.payload.size(), sizeof header);
  out.put_count(behind / 4);
  std::size_t at = sizeof header;
  for (std::size_t value = 0; value < behind / 4; ++value, at += 4) out.put_raw(&command.payload[at], 4);
  out.put_octets(behind % 4 == 0 ? std::span<const std::byte>{} : std::span(command.payload).subspan(at));
  out.put(command.crc);
  out.put(command.whole_crc);
  out.put(static_cast<std::uint8_t>(command.sender));
}

bool decode_command(std::span<const std::byte> message, RecordedCommand& out) {
  CdrReader reader(message);
  out.tick = reader.get<std::uint64_t>();
  const std::size_t byte_count = reader.get_count(sizeof(CommandChunk));
  out.payload.assign(sizeof(CommandHeader), std::byte{0});
  for (const TickField& field : kCommandFields) reader.get_raw(&out.payload[field.offset], size_of(field.type));
  for (std::size_t at = kReservedAt; at < sizeof(CommandHeader); ++at) reader.get_raw(&out.payload[at], 1);
  const std::size_t values = reader.get_count(kMaxChunkValues);
  out.payload.resize(sizeof(CommandHeader) + 4 * values);
  for (std::size_t value = 0; value < values; ++value) {
    reader.get_raw(&out.payload[sizeof(CommandHeader) + 4 * value], 4);
  }
  const auto rest = reader.get_octets();
  out.payload.insert(out.payload.end(), rest.begin(), rest.end());
  out.crc = reader.get<std::uint32_t>();
  out.whole_crc = reader.get<std::uint32_t>();
  out.sender = static_cast<Player>(reader.get<std::uint8_t>());
  out.cut_from = byte_count > out.payload.size() ? static_cast<std::uint32_t>(byte_count) : 0;
  if (out.sender == Player::none) out.sender = Player::policy;  // of a run in which there was no other
  if (static_cast<std::size_t>(out.sender) >= kPlayerCount) return false;
  if (!reader.ok() || (out.cut_from != 0 && out.payload.size() != sizeof(CommandHeader))) return false;
  if (out.cut_from == 0) out.payload.resize(byte_count);
  return true;
}

std::optional<std::string> mend_flipped_bit(RecordedCommand& command) {
  constexpr std::size_t kSearchedBytes = 4096;  // the search is quadratic in the size
  Bytes& payload = command.payload;
  if (payload.size() > kSearchedBytes) return std::nullopt;
  for (std::size_t bit = 0; bit < 8 * payload.size(); ++bit) {
    const std::byte mask{static_cast<unsigned char>(1U << (bit % 8))};
    payload[bit / 8] ^= mask;
    if (crc_of(command) == command.crc) return place_in_command(bit / 8);
    payload[bit / 8] ^= mask;
  }
  return std::nullopt;
}

void encode_keyframe(const RecordedKeyframe& keyframe, CdrWriter& out) {
  out.clear();
  out.put(keyframe.tick);
  out.put_octets(keyframe.state);
  out.put(ipc::crc32c(keyframe.state));
}

bool decode_keyframe(std::span<const std::byte> message, RecordedKeyframe& out) {
  CdrReader reader(message);
  out.tick = reader.get<std::uint64_t>();
  const auto state = reader.get_octets();
  out.state.assign(state.begin(), state.end());
  const auto crc = reader.get<std::uint32_t>();
  return reader.ok() && crc == ipc::crc32c(out.state);
}

void encode_transition(const Transition& transition, CdrWriter& out) {
  out.clear();
  out.put(transition.tick);
  out.put(transition.at.ns);
  out.put(static_cast<std::uint8_t>(transition.from));
  out.put(static_cast<std::uint8_t>(transition.to));
  out.put(static_cast<std::uint8_t>(transition.cause));
  out.put_string(fmt::format("{} -> {}: {}", name(transition.from), name(transition.to), name(transition.cause)));
}

void encode_loss(const Loss& loss, CdrWriter& out) {
  out.clear();
  out.put_string(loss.ring);
  out.put_string(loss.reason);
  out.put(loss.count);
  out.put(loss.after_tick);
  out.put(loss.before_tick);
}

bool decode_loss(std::span<const std::byte> message, Loss& out) {
  CdrReader reader(message);
  out.ring = reader.get_string();
  out.reason = reader.get_string();
  out.count = reader.get<std::uint64_t>();
  out.after_tick = reader.get<std::uint64_t>();
  out.before_tick = reader.get<std::uint64_t>();
  return reader.ok();
}

}  // namespace takt::monitor
