// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/mit/damiao_registers.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "drivers/protocol/drive_timeout.hpp"
#include "drivers/protocol/little_endian.hpp"

namespace takt::drivers {
namespace {

constexpr std::uint8_t kReadRegister = 0x33, kWriteRegister = 0x55;
constexpr std::uint32_t kMitMode = 1;
constexpr std::uint32_t kTicksPerQuestion = 4;  // several drives that are asked at once must not crowd the bus
// The drive computes with the float32 it stores; the robot file's number went through the same rounding.
constexpr float kSameWithin = 1e-6F;

constexpr std::array kAsked{DamiaoRegister::control_mode,  DamiaoRegister::p_max,    DamiaoRegister::v_max,
                            DamiaoRegister::t_max,         DamiaoRegister::hardware, DamiaoRegister::firmware,
                            DamiaoRegister::serial_number, DamiaoRegister::bit_rate, DamiaoRegister::timeout};

bool is_same(std::uint32_t bits, float expected) noexcept {
  return std::abs(std::bit_cast<float>(bits) - expected) <= kSameWithin * expected;  // false for NaN
}

CanFrame register_frame(std::uint32_t drive_id, std::uint8_t operation, DamiaoRegister which) noexcept {
  CanFrame frame;
  frame.id = kDamiaoRegisterId;
  frame.length = 8;
  frame.data[0] = static_cast<std::uint8_t>(drive_id & 0xFFU);
  frame.data[1] = static_cast<std::uint8_t>(drive_id >> 8U & 0xFFU);
  frame.data[2] = operation;
  frame.data[3] = static_cast<std::uint8_t>(which);
  return frame;
}

}  // namespace

CanFrame encode_damiao_question(std::uint32_t drive_id, DamiaoRegister which) noexcept {
  return register_frame(drive_id, kReadRegister, which);
}

CanFrame encode_damiao_order(std::uint32_t drive_id, DamiaoRegister which, std::uint32_t value) noexcept {
  CanFrame frame = register_frame(drive_id, kWriteRegister, which);
  put_u32(frame.data + 4, value);
  return frame;
}

std::optional<DamiaoAnswer> decode_damiao_answer(std::uint32_t drive_id, const CanFrame& frame, bool fd) noexcept {
  const bool plain = !frame.extended && frame.fd == fd && !frame.remote && !frame.error;
  if (!plain || frame.length != 8) return std::nullopt;
  const std::uint8_t* data = frame.data;
  const auto which = static_cast<DamiaoRegister>(data[3]);
  const bool about_it = (std::uint32_t{data[0]} | std::uint32_t{data[1]} << 8U) == drive_id &&
                        (data[2] == kReadRegister || data[2] == kWriteRegister);
  if (!about_it || std::ranges::find(kAsked, which) == kAsked.end()) return std::nullopt;
  return DamiaoAnswer{which, get_u32(data + 4), data[2] == kReadRegister};
}

std::optional<CanFrame> DamiaoReadback::next() noexcept {
  if (stage_ == Stage::agreed) return std::nullopt;
  ++tick_;
  if (stage_ == Stage::failed && tick_ >= kTicksToRetry) restart();
  // Ids on a bus differ, and with them the ticks in which their drives are asked.
  if (stage_ == Stage::failed || tick_ % kTicksPerQuestion != drive_id_ % kTicksPerQuestion) return std::nullopt;
  if (tries_ == kTries) {
    give_up();
    return std::nullopt;
  }
  const bool about_timeout = kAsked[asked_] == DamiaoRegister::timeout;
  if (about_timeout && !std::exchange(ordered_, true))
    return encode_damiao_order(drive_id_, DamiaoRegister::timeout, wish_.units);
  ordered_ = false;
  ++tries_;
  return encode_damiao_question(drive_id_, kAsked[asked_]);
}

void DamiaoReadback::take(const DamiaoAnswer& answer) noexcept {
  // A second answer to a question that was repeated tells nothing new.
  if (stage_ != Stage::asking || answer.which != kAsked[asked_] || tries_ == 0 || !answer.to_question) return;
  if (!agrees(answer)) {
    fail(SetupFault::settings_differ, answer.which);
    return;
  }
  if (answer.which == DamiaoRegister::timeout) return take_timeout(answer.value);
  next_register();
}

void DamiaoReadback::next_register() noexcept {
  tries_ = 0;
  ++asked_;
  if (kAsked[asked_] == DamiaoRegister::bit_rate && bit_rate_ == 0) ++asked_;
}

void DamiaoReadback::take_timeout(std::uint32_t units) noexcept {
  timeout_ = units;
  // Otherwise the order was lost, or is not obeyed: again, and in the end give_up() judges what is there.
  if (units == wish_.units) agree();
}

void DamiaoReadback::agree() noexcept {
  stage_ = Stage::agreed;
  error_code_ = 0;
}

void DamiaoReadback::restart() noexcept {
  stage_ = Stage::asking;
  asked_ = 0;
  tries_ = 0;
  tick_ = 0;
  ordered_ = false;
  timeout_.reset();
}

void DamiaoReadback::give_up() noexcept {
  const DamiaoRegister which = kAsked[asked_];
  if (may_stay_unread(which)) return next_register();
  if (which != DamiaoRegister::timeout) return fail(SetupFault::settings_unread, which);
  if (wish_.waived || is_watchdog(timeout_)) return agree();
  fail(timeout_ ? SetupFault::watchdog_off : SetupFault::watchdog_unknown, which);
}

void DamiaoReadback::fail(SetupFault fault, DamiaoRegister which) noexcept {
  stage_ = Stage::failed;
  tick_ = 0;
  error_code_ = setup_fault_code(fault, static_cast<std::uint32_t>(which));
}

bool DamiaoReadback::agrees(const DamiaoAnswer& answer) const noexcept {
  switch (answer.which) {
    case DamiaoRegister::control_mode:
      return answer.value == kMitMode;
    case DamiaoRegister::p_max:
      return is_same(answer.value, expected_.p);
    case DamiaoRegister::v_max:
      return is_same(answer.value, expected_.v);
    case DamiaoRegister::t_max:
      return is_same(answer.value, expected_.t);
    case DamiaoRegister::firmware:
      return answer.value == identity_.firmware.value_or(answer.value);
    case DamiaoRegister::serial_number:
      return answer.value == identity_.serial_number.value_or(answer.value);
    case DamiaoRegister::bit_rate:
      return answer.value == bit_rate_;
    case DamiaoRegister::hardware:
    case DamiaoRegister::timeout:
      return true;
  }
  return false;
}

bool DamiaoReadback::may_stay_unread(DamiaoRegister which) const noexcept {
  switch (which) {
    case DamiaoRegister::hardware:
      return true;
    case DamiaoRegister::firmware:
      return !identity_.firmware;
    case DamiaoRegister::serial_number:
      return !identity_.serial_number;
    case DamiaoRegister::control_mode:
    case DamiaoRegister::p_max:
    case DamiaoRegister::v_max:
    case DamiaoRegister::t_max:
    case DamiaoRegister::bit_rate:
    case DamiaoRegister::timeout:
      return false;
  }
  return false;
}

const char* damiao_register_name(std::uint32_t number) {
  switch (static_cast<DamiaoRegister>(number)) {
    case DamiaoRegister::control_mode:
      return "control mode (register 10)";
    case DamiaoRegister::p_max:
      return "position range (register 21)";
    case DamiaoRegister::v_max:
      return "velocity range (register 22)";
    case DamiaoRegister::t_max:
      return "torque range (register 23)";
    case DamiaoRegister::timeout:
      return "time-out (register 9)";
    case DamiaoRegister::hardware:
      return "hardware version (register 13)";
    case DamiaoRegister::firmware:
      return "firmware (register 14)";
    case DamiaoRegister::serial_number:
      return "identity (register 15)";
    case DamiaoRegister::bit_rate:
      return "bit rate of CAN FD (register 35)";
  }
  return "";
}

}  // namespace takt::drivers
