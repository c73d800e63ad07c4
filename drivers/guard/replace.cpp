// SPDX-License-Identifier: Apache-2.0
// Sources: as the decoders'.
#include "drivers/guard/replace.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <numbers>

#include "drivers/guard/judge.hpp"
#include "drivers/guard/wire_bytes.hpp"

namespace takt::drivers::guard {
namespace {

using config::Cia402Mode;
using config::DriveProtocol;

CanFrame frame_with(std::uint32_t id, std::initializer_list<std::uint8_t> bytes) noexcept {
  CanFrame frame;
  frame.id = id;
  frame.length = static_cast<std::uint8_t>(bytes.size());
  std::ranges::copy(bytes, frame.data);
  return frame;
}

CanFrame mit_frame(const JointFacts& facts, std::initializer_list<std::uint8_t> bytes) noexcept {
  CanFrame frame = frame_with(facts.id, bytes);
  frame.fd = frame.bit_rate_switch = facts.fd;
  return frame;
}

CanFrame extended(CanFrame frame) noexcept {
  frame.extended = true;
  return frame;
}

// Rounded down, and never beyond the field: damping only ever gets weaker on its way.
std::uint32_t gain_code(const JointFacts& facts, float top) noexcept {
  const float motor_side = facts.damping / (facts.ratio * facts.ratio);
  return static_cast<std::uint32_t>(std::clamp(motor_side / facts.range.kd * top, 0.0F, top));
}

constexpr std::uint8_t high(std::uint32_t code) {
  return static_cast<std::uint8_t>(code >> 8U & 0xFFU);
}
constexpr std::uint8_t low(std::uint32_t code) {
  return static_cast<std::uint8_t>(code & 0xFFU);
}

// Position, speed and torque in the middle of their fields, no stiffness.
CanFrame damping_mit(const JointFacts& facts) noexcept {
  const std::uint32_t kd = gain_code(facts, 4095);
  return mit_frame(
      facts, {0x7F, 0xFF, 0x7F, 0xF0, 0x00, low(kd >> 4U), static_cast<std::uint8_t>((kd & 0xFU) << 4U | 0x7U), 0xFF});
}

CanFrame damping_robstride(const JointFacts& facts) noexcept {
  const std::uint32_t kd = gain_code(facts, 65535);
  constexpr std::uint32_t kMotion = 1, kNoTorque = 0x7FFF;
  return extended(
      frame_with(kMotion << 24U | kNoTorque << 8U | facts.id, {0x7F, 0xFF, 0x7F, 0xFF, 0x00, 0x00, high(kd), low(kd)}));
}

CanFrame torque_odrive(const JointFacts& facts, float torque) noexcept {
  CanFrame frame = frame_with(facts.id << 5U | 0x0EU, {0, 0, 0, 0});
  write_little_float(frame.data, torque);
  return frame;
}

constexpr std::array<std::uint8_t, 8> kMoteusQuestion{0x11, 0x00, 0x1F, 0x01, 0x12, 0x0E, 0x11, 0x0A};

CanFrame to_moteus(const JointFacts& facts, std::initializer_list<std::uint8_t> bytes) noexcept {
  CanFrame frame = extended(frame_with(0x8000U | facts.id, bytes));
  frame.fd = frame.bit_rate_switch = true;
  return frame;
}

CanFrame disable_moteus(const JointFacts& facts) noexcept {
  CanFrame frame = to_moteus(facts, {0x01, 0x00, 0x00, 0, 0, 0, 0, 0, 0, 0, 0, 0x50});
  std::ranges::copy(kMoteusQuestion, frame.data + 3);
  return frame;
}

// The firmware holds damping down to stiffness: with neither, damping is a torque.
CanFrame torque_moteus(const JointFacts& facts, float position, float torque) noexcept {
  CanFrame frame = to_moteus(facts, {0x01, 0x00, 0x0A, 0x0C, 0x06, 0x20});
  const std::array values{position / (2 * std::numbers::pi_v<float>), 0.0F, torque, 0.0F, 0.0F, facts.torque_range};
  std::uint8_t* at = frame.data + frame.length;
  for (const float value : values) {
    write_little_float(at, value);
    at += 4;
  }
  *at++ = 0x0D;
  *at++ = 0x27;
  write_little_float(at, static_cast<float>(facts.shortest_watchdog.seconds()));
  at += 4;
  constexpr std::array<std::uint8_t, 4> kNoTrajectory{0x02, 0x28, 0xFF, 0xFF};
  at = std::ranges::copy(kNoTrajectory, at).out;
  at = std::ranges::copy(kMoteusQuestion, at).out;
  frame.length = 48;
  std::fill(at, frame.data + frame.length, std::uint8_t{0x50});
  return frame;
}

CanFrame to_cia402(const JointFacts& facts, std::uint8_t controlword, std::int32_t target) noexcept {
  const auto bits = static_cast<std::uint32_t>(target);
  const std::uint32_t id = 0x200U + facts.id;
  switch (facts.mode) {
    case Cia402Mode::cst:
      return frame_with(id, {controlword, 0, 10, low(bits), high(bits)});
    case Cia402Mode::csv:
    case Cia402Mode::csp: {
      const std::uint8_t mode = facts.mode == Cia402Mode::csp ? 8 : 9;
      return frame_with(id, {controlword, 0, mode, low(bits), high(bits), low(bits >> 16U), high(bits >> 16U)});
    }
  }
  return {};
}

std::int32_t cia402_target(const JointFacts& facts, float motor_torque, double motor_position) noexcept {
  switch (facts.mode) {
    case Cia402Mode::cst:
      return static_cast<std::int32_t>(std::clamp(motor_torque / facts.torque_per_mille, -32767.0F, 32767.0F));
    case Cia402Mode::csv:
      return 0;
    case Cia402Mode::csp:
      return static_cast<std::int32_t>(
          std::clamp(std::round(motor_position / facts.rad_per_count), -2147483647.0, 2147483647.0));
  }
  return 0;
}

// Of the slower of the two that measure it; 0: they do not agree on a direction. NaN agrees with nothing.
float agreed_speed(const JointRecord& record) noexcept {
  const float estimate = record.dq_estimate, own = record.feedback.dq;
  if (!(std::isfinite(estimate) && std::isfinite(own) && estimate * own > 0)) return 0;
  return std::abs(estimate) < std::abs(own) ? estimate : own;
}

float braking_torque(const JointFacts& facts, const JointRecord& record, const LastTold& last) noexcept {
  const float speed = agreed_speed(record);
  const float wanted = std::clamp(-facts.damping * speed, -facts.torque, facts.torque);
  const Range slew = torques_within_slew(facts, last);
  return std::clamp(wanted, std::min(slew.low, 0.0F), std::max(slew.high, 0.0F));
}

// At the estimate, where the drive damps by its own measurement: what the tick's next torque starts from.
float torque_of_damping(const JointFacts& facts, const JointRecord& record, bool heard, const LastTold& last) noexcept {
  if (!heard) return 0;
  switch (facts.protocol) {
    case DriveProtocol::mit:
    case DriveProtocol::robstride: {
      const float torque = -facts.damping * record.dq_estimate;
      return std::isfinite(torque) ? std::clamp(torque, -facts.torque, facts.torque) : 0.0F;
    }
    case DriveProtocol::odrive:
    case DriveProtocol::moteus:
    case DriveProtocol::cia402:
      return braking_torque(facts, record, last);
  }
  return 0;
}

}  // namespace

CanFrame disable_frame(const JointFacts& facts) noexcept {
  switch (facts.protocol) {
    case DriveProtocol::mit:
      return mit_frame(facts, {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD});
    case DriveProtocol::robstride:
      return extended(frame_with(4U << 24U | facts.host << 8U | facts.id, {0, 0, 0, 0, 0, 0, 0, 0}));
    case DriveProtocol::odrive:
      return frame_with(facts.id << 5U | 0x07U, {1, 0, 0, 0});
    case DriveProtocol::moteus:
      return disable_moteus(facts);
    case DriveProtocol::cia402:
      return to_cia402(facts, 0x00, 0);
  }
  return {};
}

CanFrame damping_frame(const JointFacts& facts, const JointRecord& record, bool heard, LastTold& last) noexcept {
  const float joint_torque = torque_of_damping(facts, record, heard, last);
  const bool is_heard_of = record.feedback.received_at.is_set() && std::isfinite(record.feedback.q);
  if (facts.law == Law::position && !last.has_position && !is_heard_of) {
    last = {};
    return disable_frame(facts);
  }
  const float q = last.has_position ? last.q : (is_heard_of ? record.feedback.q : 0.0F);
  last = {.torque = joint_torque, .q = q, .has_position = facts.law == Law::position};
  const float torque = joint_torque / facts.ratio;
  const float position = (q - facts.offset) * facts.ratio;
  switch (facts.protocol) {
    case DriveProtocol::mit:
      return damping_mit(facts);
    case DriveProtocol::robstride:
      return damping_robstride(facts);
    case DriveProtocol::odrive:
      return torque_odrive(facts, torque);
    case DriveProtocol::moteus:
      return torque_moteus(facts, position, torque);
    case DriveProtocol::cia402:
      return to_cia402(facts, 0x0F, cia402_target(facts, torque, double{position}));
  }
  return {};
}

}  // namespace takt::drivers::guard
