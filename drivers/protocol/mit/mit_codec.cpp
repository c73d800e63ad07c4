// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/mit/mit_codec.hpp"

#include <algorithm>
#include <cmath>

namespace takt::drivers {
namespace {

constexpr float top(int bits) {
  return static_cast<float>((1 << bits) - 1);
}

// Precondition: x finite, min < max.
std::uint32_t to_field(float x, float min, float max, int bits) noexcept {
  const float inside = std::clamp(x, min, max);
  const float scaled = (inside - min) * top(bits) / (max - min);
  // Ranges that are no round numbers may round up past the last code.
  return static_cast<std::uint32_t>(std::min(scaled, top(bits)));
}

float from_field(std::uint32_t field, float min, float max, int bits) noexcept {
  return static_cast<float>(field) * (max - min) / top(bits) + min;
}

constexpr std::uint8_t low_byte(std::uint32_t value) {
  return static_cast<std::uint8_t>(value & 0xFFU);
}

float finite_or_zero(float x) noexcept {
  return std::isfinite(x) ? x : 0.0F;
}

// A value that is not finite can only be our own bug upstream: the safest frame is one that pushes nowhere.
MitCommand made_finite(const MitCommand& command) noexcept {
  const bool finite = std::isfinite(command.p) && std::isfinite(command.v) && std::isfinite(command.kp) &&
                      std::isfinite(command.kd) && std::isfinite(command.t);
  if (finite) return command;
  return {.p = 0, .v = 0, .kp = 0, .kd = finite_or_zero(command.kd), .t = 0};
}

MitPayload pack(std::uint32_t p, std::uint32_t v, std::uint32_t kp, std::uint32_t kd, std::uint32_t t) noexcept {
  return {low_byte(p >> 8U),
          low_byte(p),
          low_byte(v >> 4U),
          low_byte((v & 0xFU) << 4U | kp >> 8U),
          low_byte(kp),
          low_byte(kd >> 4U),
          low_byte((kd & 0xFU) << 4U | t >> 8U),
          low_byte(t)};
}

bool starts_like_special(const MitPayload& payload) noexcept {
  return std::all_of(payload.begin(), payload.end() - 2, [](std::uint8_t byte) { return byte == 0xFF; });
}

}  // namespace

MitPayload encode_mit_command(const MitRange& range, const MitCommand& command) noexcept {
  const MitCommand wanted = made_finite(command);
  const std::uint32_t p = to_field(wanted.p, -range.p, range.p, 16);
  const std::uint32_t v = to_field(wanted.v, -range.v, range.v, 12);
  const std::uint32_t kp = to_field(wanted.kp, 0, range.kp, 12);
  const std::uint32_t kd = to_field(wanted.kd, 0, range.kd, 12);
  const std::uint32_t t = to_field(wanted.t, -range.t, range.t, 12);
  const MitPayload payload = pack(p, v, kp, kd, t);
  return starts_like_special(payload) ? pack(p, v, kp - 1, kd, t) : payload;
}

MitPayload encode_mit_special(MitSpecial special) noexcept {
  MitPayload payload;
  payload.fill(0xFF);
  payload.back() = static_cast<std::uint8_t>(special);
  return payload;
}

bool is_ak_v3_feedback(std::uint32_t drive_id, const CanFrame& frame) noexcept {
  const bool classic = frame.extended && !frame.fd && !frame.remote && !frame.error;
  return classic && frame.length == 8 && frame.id == (kAkV3Feedback | drive_id);
}

bool is_robstride_reply(std::uint32_t drive_id, const CanFrame& frame) noexcept {
  constexpr std::uint8_t kHighestByte = 3, kHighestErrorCode = 15;
  const bool classic = !frame.extended && !frame.fd && !frame.remote && !frame.error && frame.length == 8;
  if (!classic || frame.data[0] != drive_id || frame.data[6] > kHighestByte) return false;
  return frame.data[6] != 0 || frame.data[7] > kHighestErrorCode;  // 0: perhaps a T-Motor drive without a sensor
}

std::optional<MitReply> decode_mit_reply(const MitRange& range, MitVariant variant, const CanFrame& frame,
                                         bool fd) noexcept {
  const bool plain = !frame.extended && frame.fd == fd && !frame.remote && !frame.error;
  const bool long_reply = frame.length == 8;
  if (!plain || (!long_reply && (variant != MitVariant::tmotor || frame.length != 6))) return std::nullopt;
  const std::uint8_t* data = frame.data;
  MitReply reply;
  reply.p = from_field(std::uint32_t{data[1]} << 8U | data[2], -range.p, range.p, 16);
  reply.v = from_field(std::uint32_t{data[3]} << 4U | data[4] >> 4U, -range.v, range.v, 12);
  reply.t = from_field((data[4] & 0xFU) << 8U | data[5], -range.t, range.t, 12);
  switch (variant) {
    case MitVariant::damiao:
      reply.id = data[0] & 0xFU;
      reply.status = static_cast<std::uint8_t>(data[0] >> 4U);
      reply.temperature_C = static_cast<float>(std::max(data[6], data[7]));
      reply.stage_C = data[6];
      break;
    case MitVariant::tmotor:
      reply.id = data[0];
      reply.temperature_C = long_reply ? static_cast<float>(data[6]) - kTmotorColdest_C : 0.0F;
      reply.status = long_reply ? data[7] : std::uint8_t{0};
      break;
    case MitVariant::robstride:
      reply.id = data[0];
      reply.temperature_C = static_cast<float>(static_cast<std::int16_t>(data[6] << 8U | data[7])) / 10;
      break;
  }
  return reply;
}

}  // namespace takt::drivers
