// SPDX-License-Identifier: Apache-2.0
// The messages of a recorded run beside the tick itself: what they hold, their ros2msg text, their CDR form.
//
//   /takt/tick        takt_msgs/msg/Tick        every control tick (tick_schema.hpp)
//   /takt/command     takt_msgs/msg/Command     every message read from a policy, byte for byte; of refused ones a
//   sample /takt/keyframe    takt_msgs/msg/Keyframe    the decision's saved state after a tick: replay starts there
//   /takt/transition  takt_msgs/msg/Transition  a change of mode and its cause
//   /takt/loss        takt_msgs/msg/Loss        what was not recorded, and why
//   /takt/policy_input  takt_msgs/msg/PolicyInput  what a policy was shown and said (policy_input_message.hpp)
//   /takt/image       takt_msgs/msg/Image       an image that a policy was shown (image_message.hpp)
//   /SENSOR/compressed  sensor_msgs/msg/CompressedImage  such images as PNG, as many as fit (image_watch.hpp)
//   /joint_states     sensor_msgs/msg/JointState  decimated, for the usual viewers (standard_messages.hpp), as the rest
//   /diagnostics      diagnostic_msgs/msg/DiagnosticArray  once a second and when the mode changes, as DDS tells it
//   /rosout           rcl_interfaces/msg/Log      a line for each transition and each mark
//   /robot_description  std_msgs/msg/String       of a robot with a `model`: its URDF, once (robot_description.hpp)
//   /tf               tf2_msgs/msg/TFMessage      of a robot with a `model`: its links' frames, decimated
// In the file a tick's command comes before the tick, everything else about it behind it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/tick_record.hpp"
#include "monitor/record/cdr.hpp"
#include "monitor/record/mcap_writer.hpp"

namespace takt::monitor {

enum class Topic : std::uint16_t {
  tick = 1,
  command,
  keyframe,
  transition,
  loss,
  joint_states,
  diagnostics,
  log,
  policy_input,
  image,
  robot_description,
  transforms
};

// In the order of Topic, so that channel ids are Topic values.
std::vector<McapTopic> run_topics();
std::string_view topic_name(Topic topic);
// Of one camera's pictures. Channel ids of theirs follow those of run_topics().
McapTopic picture_topic(std::string_view sensor);

struct RecordedCommand {
  std::uint64_t tick = 0;       // that read it
  Bytes payload;                // as read from the mailbox, never more than a CommandChunk
  std::uint32_t crc = 0;        // crc_of() when it was recorded
  std::uint32_t cut_from = 0;   // bytes of a refused message of which only the header was kept; 0: it is whole
  std::uint32_t whole_crc = 0;  // CRC-32C of that message; 0: longer than any legal one, not read
  Player sender = Player::policy;
};
// CRC-32C of the payload, and of what stands for the rest where it was cut.
std::uint32_t crc_of(const RecordedCommand& command);
// Nothing: the message was cut short.
std::optional<CommandHeader> header_of(const RecordedCommand& command);
// Nothing for the fallback policy's messages too: what judges the policy does not read them.
std::optional<CommandHeader> policy_header_of(const RecordedCommand& command);
void encode_command(const RecordedCommand& command, CdrWriter& out);
bool decode_command(std::span<const std::byte> message, RecordedCommand& out);
// When one flipped bit explains a checksum that does not match: puts it right and names its place, "infer_ended_at" or
// "values[3]". Searches messages of up to 4 KiB.
std::optional<std::string> mend_flipped_bit(RecordedCommand& command);

struct RecordedKeyframe {
  std::uint64_t tick = 0;  // the state is the one after this tick
  Bytes state;             // pipeline::save
};
void encode_keyframe(const RecordedKeyframe& keyframe, CdrWriter& out);
bool decode_keyframe(std::span<const std::byte> message, RecordedKeyframe& out);

struct Transition {
  std::uint64_t tick = 0;
  MonoTime at;
  Mode from = Mode::standby;
  Mode to = Mode::standby;
  Cause cause = Cause::none;
};
void encode_transition(const Transition& transition, CdrWriter& out);

inline constexpr std::array<std::string_view, 7> kRingNames{"tick",         "command",        "keyframe",       "frame",
                                                            "policy_input", "fallback_input", "candidate_input"};
// Of what is no ring, but images that policies were shown: reasons are image_message.hpp's names, but for `stored`.
inline constexpr std::string_view kImageLoss = "image";
inline constexpr std::array<std::string_view, 3> kRingLossReasons{"overwritten", "before_attach", "unreadable"};
inline constexpr std::string_view kTooMany = "too_many";                    // of policies' inputs alone
inline constexpr std::string_view kRecordingStopped = "recording_stopped";  // of the tick ring alone
// Of the tick ring and of policies' inputs: no loss, but what standby_thinner.hpp left out.
inline constexpr std::string_view kStoodBy = "standby";

struct Loss {
  std::string ring;         // of kRingNames, or kImageLoss
  std::string reason;       // of kRingLossReasons, kTooMany, kRecordingStopped, kStoodBy, or what became of an image
  std::uint64_t count = 0;  // entries of the ring
  std::uint64_t after_tick = 0;   // last tick recorded before the gap; 0 none
  std::uint64_t before_tick = 0;  // first tick recorded after it; 0 none
};
void encode_loss(const Loss& loss, CdrWriter& out);
bool decode_loss(std::span<const std::byte> message, Loss& out);

}  // namespace takt::monitor
