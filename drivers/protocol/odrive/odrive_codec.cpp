// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/odrive/odrive_codec.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/protocol/little_endian.hpp"

namespace takt::drivers {
namespace {

constexpr float kFeedForwardStep = 0.001F;  // of Input_Pos: turn/s and Nm

CanFrame frame_of(std::uint32_t node, OdriveMessage message, std::uint8_t length) noexcept {
  CanFrame frame;
  frame.id = odrive_id(node, message);
  frame.length = length;
  return frame;
}

CanFrame word_frame(std::uint32_t node, OdriveMessage message, std::uint32_t word) noexcept {
  CanFrame frame = frame_of(node, message, 4);
  put_u32(frame.data, word);
  return frame;
}

CanFrame pair_frame(std::uint32_t node, OdriveMessage message, float first, float second) noexcept {
  CanFrame frame = frame_of(node, message, 8);
  put_f32(frame.data, first);
  put_f32(frame.data + 4, second);
  return frame;
}

std::uint16_t in_thousandths(float value) noexcept {
  if (std::isnan(value)) return 0;
  const float steps = std::clamp(std::round(value / kFeedForwardStep), -32768.0F, 32767.0F);
  return static_cast<std::uint16_t>(static_cast<std::int16_t>(steps));
}

bool is_report(std::uint32_t node, OdriveMessage message, const CanFrame& frame) noexcept {
  return frame.id == odrive_id(node, message) && !frame.extended && !frame.fd && !frame.remote && !frame.error &&
         frame.length == 8;
}

}  // namespace

CanFrame odrive_estop(std::uint32_t node) noexcept {
  return frame_of(node, OdriveMessage::estop, 0);
}

CanFrame odrive_set_axis_state(std::uint32_t node, std::uint32_t state) noexcept {
  return word_frame(node, OdriveMessage::set_axis_state, state);
}

CanFrame odrive_set_absolute_position(std::uint32_t node, float turns) noexcept {
  return pair_frame(node, OdriveMessage::set_absolute_position, turns, 0);
}

CanFrame odrive_controller_mode(std::uint32_t node, std::uint32_t control, std::uint32_t input) noexcept {
  CanFrame frame = frame_of(node, OdriveMessage::controller_mode, 8);
  put_u32(frame.data, control);
  put_u32(frame.data + 4, input);
  return frame;
}

CanFrame odrive_input_pos(std::uint32_t node, float turns, float velocity_ff, float torque_ff) noexcept {
  CanFrame frame = frame_of(node, OdriveMessage::input_pos, 8);
  put_f32(frame.data, turns);
  put_u16(frame.data + 4, in_thousandths(velocity_ff));
  put_u16(frame.data + 6, in_thousandths(torque_ff));
  return frame;
}

CanFrame odrive_input_vel(std::uint32_t node, float turns_per_s, float torque_ff) noexcept {
  return pair_frame(node, OdriveMessage::input_vel, turns_per_s, torque_ff);
}

CanFrame odrive_input_torque(std::uint32_t node, float torque_Nm) noexcept {
  CanFrame frame = frame_of(node, OdriveMessage::input_torque, 4);
  put_f32(frame.data, torque_Nm);
  return frame;
}

CanFrame odrive_limits(std::uint32_t node, float turns_per_s, float current_A) noexcept {
  return pair_frame(node, OdriveMessage::limits, turns_per_s, current_A);
}

CanFrame odrive_clear_errors(std::uint32_t node) noexcept {
  return frame_of(node, OdriveMessage::clear_errors, 1);  // its one byte asks the drive to blink: no
}

CanFrame odrive_get_version(std::uint32_t node) noexcept {
  CanFrame frame = frame_of(node, OdriveMessage::get_version, 0);
  frame.remote = true;
  return frame;
}

std::optional<OdriveHeartbeat> decode_odrive_heartbeat(std::uint32_t node, const CanFrame& frame) noexcept {
  if (!is_report(node, OdriveMessage::heartbeat, frame)) return std::nullopt;
  constexpr std::uint8_t kFlagsOf05 = 0x81;
  const std::uint8_t last = frame.data[7];
  return OdriveHeartbeat{get_u32(frame.data), frame.data[4], frame.data[5], (frame.data[6] & 1U) != 0,
                         last != 0 && (last & ~kFlagsOf05) == 0};
}

std::optional<OdriveErrors> decode_odrive_errors(std::uint32_t node, const CanFrame& frame) noexcept {
  if (!is_report(node, OdriveMessage::get_error, frame)) return std::nullopt;
  return OdriveErrors{get_u32(frame.data), get_u32(frame.data + 4)};
}

std::optional<OdriveVersion> decode_odrive_version(std::uint32_t node, const CanFrame& frame) noexcept {
  if (!is_report(node, OdriveMessage::get_version, frame)) return std::nullopt;
  const auto three = [&frame](std::size_t at) {
    return std::uint32_t{frame.data[at]} << 16U | std::uint32_t{frame.data[at + 1]} << 8U | frame.data[at + 2];
  };
  return OdriveVersion{.hardware = three(1), .firmware = three(4)};
}

std::optional<OdrivePair> decode_odrive_pair(std::uint32_t node, OdriveMessage message,
                                             const CanFrame& frame) noexcept {
  if (!is_report(node, message, frame)) return std::nullopt;
  return OdrivePair{get_f32(frame.data), get_f32(frame.data + 4)};
}

}  // namespace takt::drivers
