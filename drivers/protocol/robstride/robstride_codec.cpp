// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/robstride/robstride_codec.hpp"

#include <algorithm>
#include <cmath>

namespace takt::drivers {
namespace {

constexpr std::uint32_t kIdentity = 0, kMotion = 1, kFeedback = 2, kEnable = 3, kStop = 4, kReadParameter = 17,
                        kWriteParameter = 18, kFaultReport = 21, kActiveReport = 24;
constexpr std::uint32_t kEveryHost = 0xFE;
constexpr float kTop = 65535.0F;

constexpr std::uint8_t byte_of(std::uint32_t value, unsigned index) {
  return static_cast<std::uint8_t>(value >> (8 * index) & 0xFFU);
}

// Precondition: x finite, min < max.
std::uint32_t to_code(float x, float min, float max) noexcept {
  const float scaled = (std::clamp(x, min, max) - min) * kTop / (max - min);
  // Ranges that are no round numbers may round up past the last code.
  return static_cast<std::uint32_t>(std::min(scaled, kTop));
}

float from_code(std::uint32_t code, float limit) noexcept {
  return static_cast<float>(code) * (2 * limit) / kTop - limit;
}

// A value that is not finite can only be our own bug upstream: the safest frame is one that pushes nowhere.
RobstrideCommand made_finite(const RobstrideCommand& command) noexcept {
  const bool finite = std::isfinite(command.p) && std::isfinite(command.v) && std::isfinite(command.kp) &&
                      std::isfinite(command.kd) && std::isfinite(command.t);
  if (finite) return command;
  return {.p = 0, .v = 0, .kp = 0, .kd = std::isfinite(command.kd) ? command.kd : 0.0F, .t = 0};
}

CanFrame frame_to(std::uint8_t drive, std::uint32_t type, std::uint32_t data) noexcept {
  CanFrame frame;
  frame.id = type << 24U | data << 8U | drive;
  frame.extended = true;
  frame.length = 8;
  return frame;
}

void put_big_endian(CanFrame& frame, std::size_t at, std::uint32_t code) noexcept {
  frame.data[at] = byte_of(code, 1);
  frame.data[at + 1] = byte_of(code, 0);
}

std::uint32_t big_endian(const CanFrame& frame, std::size_t at) noexcept {
  return std::uint32_t{frame.data[at]} << 8U | frame.data[at + 1];
}

std::uint32_t little_endian(const CanFrame& frame, std::size_t at) noexcept {
  std::uint32_t value = 0;
  for (std::size_t i = 4; i-- > 0;) value = value << 8U | frame.data[at + i];
  return value;
}

CanFrame parameter_frame(RobstrideAddress address, std::uint32_t type, RobstrideParameter parameter) noexcept {
  CanFrame frame = frame_to(address.drive, type, address.host);
  const auto index = static_cast<std::uint32_t>(parameter);
  frame.data[0] = byte_of(index, 0);
  frame.data[1] = byte_of(index, 1);
  return frame;
}

bool is_extended_data(const CanFrame& frame) noexcept {
  return frame.extended && !frame.fd && !frame.remote && !frame.error;
}

bool is_whole(const CanFrame& frame) noexcept {
  return is_extended_data(frame) && frame.length == 8;
}

}  // namespace

CanFrame encode_robstride_motion(const RobstrideRange& range, RobstrideAddress address,
                                 const RobstrideCommand& command) noexcept {
  const RobstrideCommand wanted = made_finite(command);
  CanFrame frame = frame_to(address.drive, kMotion, to_code(wanted.t, -range.t, range.t));
  put_big_endian(frame, 0, to_code(wanted.p, -range.p, range.p));
  put_big_endian(frame, 2, to_code(wanted.v, -range.v, range.v));
  put_big_endian(frame, 4, to_code(wanted.kp, 0, range.kp));
  put_big_endian(frame, 6, to_code(wanted.kd, 0, range.kd));
  return frame;
}

CanFrame encode_robstride_enable(RobstrideAddress address) noexcept {
  return frame_to(address.drive, kEnable, address.host);
}

CanFrame encode_robstride_stop(RobstrideAddress address, bool clear_faults) noexcept {
  CanFrame frame = frame_to(address.drive, kStop, address.host);
  frame.data[0] = clear_faults ? 1 : 0;
  return frame;
}

CanFrame encode_robstride_get_id(RobstrideAddress address) noexcept {
  return frame_to(address.drive, kIdentity, address.host);
}

CanFrame encode_robstride_question(RobstrideAddress address, RobstrideParameter parameter) noexcept {
  return parameter_frame(address, kReadParameter, parameter);
}

CanFrame encode_robstride_setting(RobstrideAddress address, RobstrideParameter parameter,
                                  std::uint32_t value) noexcept {
  CanFrame frame = parameter_frame(address, kWriteParameter, parameter);
  for (unsigned i = 0; i < 4; ++i) frame.data[4 + i] = byte_of(value, i);
  return frame;
}

std::optional<RobstrideKind> robstride_kind(RobstrideAddress address, const CanFrame& frame) noexcept {
  const std::uint32_t target = frame.id & 0xFFU;
  const bool from_drive = (frame.id >> 8U & 0xFFU) == address.drive;
  if (!frame.extended || !from_drive) return std::nullopt;
  const std::uint32_t type = frame.id >> 24U & 0x1FU;
  if (type == kIdentity && target == kEveryHost) return RobstrideKind::identity;
  if (target != address.host) return std::nullopt;
  switch (type) {
    case kFeedback:
      return RobstrideKind::feedback;
    case kReadParameter:
      return RobstrideKind::answer;
    case kFaultReport:
      return RobstrideKind::fault_report;
    case kActiveReport:
      return RobstrideKind::active_report;
    default:
      return std::nullopt;
  }
}

std::optional<RobstrideFeedback> decode_robstride_feedback(const RobstrideRange& range,
                                                           const CanFrame& frame) noexcept {
  if (!is_whole(frame)) return std::nullopt;
  const std::uint32_t state = frame.id >> 16U & 0xFFU;
  RobstrideFeedback feedback;
  feedback.p = from_code(big_endian(frame, 0), range.p);
  feedback.v = from_code(big_endian(frame, 2), range.v);
  feedback.t = from_code(big_endian(frame, 4), range.t);
  feedback.temperature_C = static_cast<float>(static_cast<std::int16_t>(big_endian(frame, 6))) / 10;
  feedback.faults = static_cast<std::uint8_t>(state & ((1U << kRobstrideFaultBits) - 1));
  feedback.mode = static_cast<RobstrideMode>(state >> kRobstrideFaultBits);
  return feedback;
}

std::optional<RobstrideIdentity> decode_robstride_identity(const CanFrame& frame) noexcept {
  if (!is_whole(frame)) return std::nullopt;
  return RobstrideIdentity{big_endian(frame, 0) << 16U | big_endian(frame, 2),
                           big_endian(frame, 4) << 16U | big_endian(frame, 6)};
}

std::optional<RobstrideAnswer> decode_robstride_answer(const CanFrame& frame) noexcept {
  if (!is_whole(frame)) return std::nullopt;
  return RobstrideAnswer{.index = static_cast<std::uint16_t>(frame.data[0] | frame.data[1] << 8U),
                         .value = little_endian(frame, 4),
                         .failed = (frame.id >> 16U & 0xFFU) != 0};
}

std::optional<RobstrideFaultReport> decode_robstride_fault_report(const CanFrame& frame) noexcept {
  if (!is_whole(frame)) return std::nullopt;
  return RobstrideFaultReport{.faults = little_endian(frame, 0), .warnings = little_endian(frame, 4)};
}

}  // namespace takt::drivers
