// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/cia402/cia402_codec.hpp"

#include <algorithm>

namespace takt::drivers::cia402 {
namespace {

void put(CanFrame& frame, std::uint32_t value, unsigned bytes) noexcept {
  for (unsigned i = 0; i < bytes; ++i) frame.data[frame.length++] = static_cast<std::uint8_t>(value >> 8 * i & 0xFFU);
}

std::uint32_t get(const CanFrame& frame, unsigned from, unsigned bytes) noexcept {
  std::uint32_t value = 0;
  for (unsigned i = 0; i < bytes; ++i) value |= std::uint32_t{frame.data[from + i]} << 8 * i;
  return value;
}

bool is_data(const CanFrame& frame, unsigned length) noexcept {
  return !frame.extended && !frame.fd && !frame.remote && !frame.error && frame.length == length;
}

CanFrame frame_to(std::uint32_t id) noexcept {
  CanFrame frame;
  frame.id = id;
  return frame;
}

CanFrame sdo_request(std::uint32_t node, std::uint8_t command, ObjectId object, std::uint32_t value) noexcept {
  CanFrame frame = frame_to(kSdoRequestId + node);
  put(frame, command, 1);
  put(frame, object.index, 2);
  put(frame, object.sub, 1);
  put(frame, value, 4);
  return frame;
}

struct TargetObject {
  PdoMap map;
  unsigned bytes;
  std::uint8_t mode;
};
constexpr TargetObject kPosition{{0x6040'0010, 0x6060'0008, 0x607A'0020}, 4, 8};
constexpr TargetObject kVelocity{{0x6040'0010, 0x6060'0008, 0x60FF'0020}, 4, 9};
constexpr TargetObject kTorque{{0x6040'0010, 0x6060'0008, 0x6071'0010}, 2, 10};

const TargetObject& target_object(config::Cia402Mode mode) noexcept {
  switch (mode) {
    case config::Cia402Mode::csp:
      return kPosition;
    case config::Cia402Mode::csv:
      return kVelocity;
    case config::Cia402Mode::cst:
      return kTorque;
  }
  return kTorque;
}

struct Pattern {
  std::uint16_t mask, value;
  PowerState state;
};
// No statusword fits two of them.
constexpr std::array kPatterns{
    Pattern{0x4F, 0x00, PowerState::not_ready},
    Pattern{0x4F, 0x40, PowerState::switch_on_disabled},
    Pattern{0x6F, 0x21, PowerState::ready},
    Pattern{0x6F, 0x23, PowerState::switched_on},
    Pattern{0x6F, 0x27, PowerState::operation_enabled},
    Pattern{0x6F, 0x07, PowerState::quick_stop},
    Pattern{0x4F, 0x0F, PowerState::fault_reaction},
    Pattern{0x4F, 0x08, PowerState::fault},
};

struct StepUp {
  PowerState from;
  std::uint16_t controlword;
};
constexpr std::array kStepsUp{
    StepUp{PowerState::switch_on_disabled, kShutdown},
    StepUp{PowerState::ready, kSwitchOn},
    StepUp{PowerState::switched_on, kEnableOperation},
    StepUp{PowerState::operation_enabled, kEnableOperation},
};

}  // namespace

CanFrame encode_nmt(NmtCommand command, std::uint32_t node) noexcept {
  CanFrame frame = frame_to(kNmtId);
  put(frame, static_cast<std::uint8_t>(command), 1);
  put(frame, node, 1);
  return frame;
}

CanFrame encode_sync() noexcept {
  return frame_to(kSyncId);
}

CanFrame encode_our_heartbeat() noexcept {
  CanFrame frame = frame_to(kHeartbeatId + kHostNode);
  put(frame, static_cast<std::uint8_t>(NmtState::operational), 1);
  return frame;
}

std::optional<NmtState> decode_heartbeat(const CanFrame& frame) noexcept {
  if (!is_data(frame, 1)) return std::nullopt;
  for (const NmtState state : {NmtState::boot, NmtState::stopped, NmtState::operational, NmtState::pre_operational})
    if (frame.data[0] == static_cast<std::uint8_t>(state)) return state;
  return std::nullopt;
}

std::optional<Emergency> decode_emergency(const CanFrame& frame) noexcept {
  if (!is_data(frame, 8)) return std::nullopt;
  return Emergency{.code = static_cast<std::uint16_t>(get(frame, 0, 2)), .error_register = frame.data[2]};
}

CanFrame encode_sdo_write(std::uint32_t node, ObjectId object, std::uint32_t value, unsigned bytes) noexcept {
  // Bits 3..2 of the command tell how many of the four data bytes are empty.
  return sdo_request(node, static_cast<std::uint8_t>(0x23U | (4U - bytes) << 2U), object, value);
}

CanFrame encode_sdo_read(std::uint32_t node, ObjectId object) noexcept {
  return sdo_request(node, 0x40, object, 0);
}

CanFrame encode_sdo_segment_request(std::uint32_t node, bool toggle) noexcept {
  return sdo_request(node, toggle ? 0x70 : 0x60, {}, 0);
}

CanFrame encode_sdo_abort(std::uint32_t node, ObjectId object) noexcept {
  constexpr std::uint32_t kGeneralError = 0x0800'0000;
  return sdo_request(node, 0x80, object, kGeneralError);
}

// 000 toggle, 3 bits for how many of the seven bytes are none, last.
std::optional<SdoSegment> decode_sdo_segment(const CanFrame& frame) noexcept {
  if (!is_data(frame, 8) || (frame.data[0] & 0xE0U) != 0) return std::nullopt;
  SdoSegment segment;
  segment.toggle = (frame.data[0] & 0x10U) != 0;
  segment.last = (frame.data[0] & 1U) != 0;
  segment.length = segment.bytes.size() - (frame.data[0] >> 1U & 7U);
  std::copy_n(frame.data + 1, segment.length, segment.bytes.begin());
  return segment;
}

std::optional<SdoAnswer> decode_sdo_answer(const CanFrame& frame) noexcept {
  if (!is_data(frame, 8)) return std::nullopt;
  SdoAnswer answer;
  answer.object = {static_cast<std::uint16_t>(get(frame, 1, 2)), frame.data[3]};
  const std::uint8_t command = frame.data[0];
  if (command == 0x60) return answer;
  if (command == 0x80) {
    answer.kind = SdoAnswer::Kind::aborted;
    answer.value = get(frame, 4, 4);
    return answer;
  }
  if (command == 0x40 || command == 0x41) {
    answer.kind = SdoAnswer::Kind::segmented;
    return answer;
  }
  answer.kind = SdoAnswer::Kind::value;
  if (command == 0x42) {  // expedited, without a size
    answer.value = get(frame, 4, 4);
    answer.is_sized = false;
    return answer;
  }
  if ((command & 0xF3U) != 0x43) return std::nullopt;
  answer.value = get(frame, 4, 4U - (command >> 2U & 3U));
  return answer;
}

const PdoMap& rpdo_map(config::Cia402Mode mode) noexcept {
  return target_object(mode).map;
}

std::size_t rpdo_bytes(config::Cia402Mode mode) noexcept {
  return 3 + target_object(mode).bytes;
}

std::uint8_t mode_of_operation(config::Cia402Mode mode) noexcept {
  return target_object(mode).mode;
}

CanFrame encode_rpdo(config::Cia402Mode mode, std::uint32_t node, std::uint16_t controlword,
                     std::int32_t target) noexcept {
  const TargetObject& object = target_object(mode);
  CanFrame frame = frame_to(kRpdo1Id + node);
  put(frame, controlword, 2);
  put(frame, object.mode, 1);
  put(frame, static_cast<std::uint32_t>(target), object.bytes);
  return frame;
}

std::optional<DriveReport> decode_tpdo(const CanFrame& frame) noexcept {
  if (!is_data(frame, kTpdoBytes)) return std::nullopt;
  return DriveReport{.statusword = static_cast<std::uint16_t>(get(frame, 0, 2)),
                     .position = static_cast<std::int32_t>(get(frame, 2, 4)),
                     .torque = static_cast<std::int16_t>(get(frame, 6, 2))};
}

PowerState power_state(std::uint16_t statusword) noexcept {
  for (const Pattern& pattern : kPatterns)
    if ((statusword & pattern.mask) == pattern.value) return pattern.state;
  return PowerState::undefined;
}

std::uint16_t step_up(PowerState state) noexcept {
  for (const StepUp& step : kStepsUp)
    if (step.from == state) return step.controlword;
  return kDisableVoltage;
}

}  // namespace takt::drivers::cia402
