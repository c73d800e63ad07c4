// SPDX-License-Identifier: Apache-2.0
// ODrive CANSimple of firmware 0.6, host side: one classic frame per command or report, fixed layouts. Pure.
//
// Standard id = node (0..63) << 5 | command; payloads little-endian, floats IEEE 754. Units on the wire are the
// drive's: motor turns, turns/s, Nm; in this header too. Firmware 0.5 differs in its heartbeat and error words and is
// not supported. The same layouts for people and tools: drivers/dbc/odrive.dbc. Sources: odriverobotics/ODriveArduino
// src/can_simple_messages.hpp, src/ODriveEnums.h.
#pragma once

#include <cstdint>
#include <numbers>
#include <optional>

#include "drivers/bus/can_bus.hpp"

namespace takt::drivers {

enum class OdriveMessage : std::uint8_t {
  get_version = 0x00,
  heartbeat = 0x01,
  estop = 0x02,
  get_error = 0x03,
  set_axis_state = 0x07,
  encoder_estimates = 0x09,
  controller_mode = 0x0B,
  input_pos = 0x0C,
  input_vel = 0x0D,
  input_torque = 0x0E,
  limits = 0x0F,
  iq = 0x14,
  temperature = 0x15,
  bus_voltage = 0x17,
  clear_errors = 0x18,
  set_absolute_position = 0x19,
  torques = 0x1C
};

inline constexpr std::uint32_t kOdriveMaxNode = 63;
constexpr std::uint32_t odrive_id(std::uint32_t node, OdriveMessage message) {
  return node << 5U | static_cast<std::uint32_t>(message);
}

inline constexpr float kRadPerTurn = 2 * std::numbers::pi_v<float>;

// Values of the protocol.
inline constexpr std::uint32_t kOdriveIdle = 1;
inline constexpr std::uint32_t kOdriveClosedLoop = 8;
inline constexpr std::uint32_t kOdriveTorqueControl = 1;
inline constexpr std::uint32_t kOdrivePassthrough = 1;

// Commands. Values are sent as they are: limits, and what to do with NaN, are the caller's business. Only the scaled
// integers of Input_Pos saturate, and send 0 for NaN.
CanFrame odrive_estop(std::uint32_t node) noexcept;
CanFrame odrive_set_axis_state(std::uint32_t node, std::uint32_t state) noexcept;
CanFrame odrive_controller_mode(std::uint32_t node, std::uint32_t control, std::uint32_t input) noexcept;
CanFrame odrive_input_pos(std::uint32_t node, float turns, float velocity_ff, float torque_ff) noexcept;
CanFrame odrive_input_vel(std::uint32_t node, float turns_per_s, float torque_ff) noexcept;
CanFrame odrive_input_torque(std::uint32_t node, float torque_Nm) noexcept;
CanFrame odrive_limits(std::uint32_t node, float turns_per_s, float current_A) noexcept;
CanFrame odrive_clear_errors(std::uint32_t node) noexcept;
// Where the drive is from now on, until its supply goes.
CanFrame odrive_set_absolute_position(std::uint32_t node, float turns) noexcept;
// A question: a remote frame, answered by the report of the same message.
CanFrame odrive_get_version(std::uint32_t node) noexcept;

// Reports, 8 bytes each. Nothing for a frame of another message or node, or of the wrong kind or length.
struct OdriveHeartbeat {
  std::uint32_t axis_error = 0;  // bits as active_errors
  std::uint8_t axis_state = 0, procedure_result = 0;
  bool trajectory_done = false;
  // Byte 7 as firmware 0.5 fills it (controller's error in bit 0, trajectory done in bit 7) and 0.6 does not; 0.5
  // numbers its errors and messages otherwise. Source: odriverobotics/ODrive Firmware/communication/can/can_simple.cpp.
  bool of_firmware_05 = false;
};
struct OdriveErrors {
  std::uint32_t active = 0, disarm_reason = 0;
};
// Major, minor and revision or variant in the lowest three bytes, as 0x00'06'0A for 0.6.10.
struct OdriveVersion {
  std::uint32_t hardware = 0, firmware = 0;
};
// The two floats of encoder estimates (turn, turn/s), Iq (set, measured A), temperature (FET, motor, deg C), bus
// voltage and current (V, A), torques (target, estimate Nm).
struct OdrivePair {
  float first = 0, second = 0;  // finite or not, as the drive sent them
};
std::optional<OdriveHeartbeat> decode_odrive_heartbeat(std::uint32_t node, const CanFrame& frame) noexcept;
std::optional<OdriveErrors> decode_odrive_errors(std::uint32_t node, const CanFrame& frame) noexcept;
std::optional<OdriveVersion> decode_odrive_version(std::uint32_t node, const CanFrame& frame) noexcept;
std::optional<OdrivePair> decode_odrive_pair(std::uint32_t node, OdriveMessage message, const CanFrame& frame) noexcept;

}  // namespace takt::drivers
