// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/can_frame.hpp"

#include <linux/can/error.h>

#include <algorithm>
#include <array>
#include <cstring>

namespace takt::drivers {
namespace {

constexpr std::array<std::uint8_t, 16> kFdLengths{0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

std::optional<CanFrame> assemble(std::uint32_t word, std::uint8_t length, bool fd, bool bit_rate_switch,
                                 const std::uint8_t* data) {
  CanFrame frame;
  frame.error = (word & CAN_ERR_FLAG) != 0;
  frame.extended = !frame.error && (word & CAN_EFF_FLAG) != 0;
  frame.remote = !frame.error && (word & CAN_RTR_FLAG) != 0;
  frame.id = word & (frame.error ? CAN_ERR_MASK : frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.fd = fd;
  frame.bit_rate_switch = fd && bit_rate_switch;
  frame.length = length;
  if (!is_legal(frame)) return std::nullopt;
  if (!frame.remote) std::memcpy(frame.data, data, length);
  return frame;
}

}  // namespace

bool is_legal(const CanFrame& frame) {
  if (frame.error) return !frame.fd && frame.id <= CAN_ERR_MASK && frame.length == CAN_ERR_DLC;
  if (frame.id > (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK)) return false;
  if (frame.fd) return !frame.remote && std::ranges::find(kFdLengths, frame.length) != kFdLengths.end();
  return frame.length <= CAN_MAX_DLEN;
}

std::uint32_t id_word(const CanFrame& frame) {
  std::uint32_t word = frame.id;
  if (frame.extended) word |= CAN_EFF_FLAG;
  if (frame.remote) word |= CAN_RTR_FLAG;
  if (frame.error) word |= CAN_ERR_FLAG;
  return word;
}

canfd_frame to_kernel(const CanFrame& frame) {
  canfd_frame raw{};
  raw.can_id = id_word(frame);
  raw.len = frame.length;
  if (frame.fd) raw.flags = static_cast<std::uint8_t>(CANFD_FDF | (frame.bit_rate_switch ? CANFD_BRS : 0));
  if (!frame.remote) std::memcpy(raw.data, frame.data, frame.length);
  return raw;
}

std::optional<CanFrame> from_kernel(const canfd_frame& frame) {
  return assemble(frame.can_id, frame.len, (frame.flags & CANFD_FDF) != 0, (frame.flags & CANFD_BRS) != 0, frame.data);
}

std::optional<CanFrame> from_kernel(const can_frame& frame) {
  return assemble(frame.can_id, frame.len, false, false, frame.data);
}

FrameRecord to_record(const CanFrame& frame, MonoTime stamp, std::uint64_t tick, std::uint8_t bus,
                      FrameDirection direction) {
  FrameRecord record;
  record.stamp = stamp;
  record.tick = tick;
  record.can_id = id_word(frame);
  record.bus = bus;
  record.direction = direction;
  record.length = frame.length;
  if (frame.fd) record.fd_flags = static_cast<std::uint8_t>(kRecordFdFlag | (frame.bit_rate_switch ? CANFD_BRS : 0));
  std::memcpy(record.data, frame.data, frame.length);
  return record;
}

std::optional<CanFrame> from_record(const FrameRecord& record) {
  return assemble(record.can_id, record.length, (record.fd_flags & kRecordFdFlag) != 0,
                  (record.fd_flags & CANFD_BRS) != 0, record.data);
}

}  // namespace takt::drivers
