#include "drivers/protocol/mit/damiao_registers.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace takt::drivers {
namespace {

constexpr std::uint8_t kRead = 0x33;
constexpr std::uint32_t kMitMode = 1;
constexpr std::uint32_t kTicksPerQuestion = 4;  // several drives that are asked at once must not crowd the bus
// The drive computes with the float32 it stores; the robot file's number went through the same rounding.
constexpr float kSameWithin = 1e-6F;

constexpr std::array kAsked{DamiaoRegister::control_mode, DamiaoRegister::p_max, DamiaoRegister::v_max,
                            DamiaoRegister::t_max, DamiaoRegister::timeout};

bool is_same(std::uint32_t bits, float expected) noexcept {
  return std::abs(std::bit_cast<float>(bits) - expected) <= kSameWithin * expected;  // false for NaN
}

}  // namespace

CanFrame encode_damiao_question(std::uint32_t drive_id, DamiaoRegister which) noexcept {
  CanFrame frame;
  frame.id = kDamiaoRegisterId;
  frame.length = 8;
  frame.data[0] = static_cast<std::uint8_t>(drive_id & 0xFFU);
  frame.data[1] = static_cast<std::uint8_t>(drive_id >> 8U & 0xFFU);
  frame.data[2] = kRead;
  frame.data[3] = static_cast<std::uint8_t>(which);
  return frame;
}

std::optional<DamiaoAnswer> decode_damiao_answer(std::uint32_t drive_id, const CanFrame& frame) noexcept {
  const bool classic = !frame.extended && !frame.fd && !frame.remote && !frame.error;
  if (!classic || frame.length != 8) return std::nullopt;
  const std::uint8_t* data = frame.data;
  const auto which = static_cast<DamiaoRegister>(data[3]);
  const bool about_it = (std::uint32_t{data[0]} | std::uint32_t{data[1]} << 8U) == drive_id && data[2] == kRead;
  if (!about_it || std::ranges::find(kAsked, which) == kAsked.end()) return std::nullopt;
  std::uint32_t value = 0;
  for (std::size_t i = 8; i-- > 4;) value = value << 8U | data[i];
  return DamiaoAnswer{which, value};
}

std::optional<CanFrame> DamiaoReadback::next() noexcept {
  if (stage_ == Stage::agreed) return std::nullopt;
  ++tick_;
  if (stage_ == Stage::failed && tick_ >= kTicksToRetry) {
    stage_ = Stage::asking;
    asked_ = 0;
    tries_ = 0;
    tick_ = 0;
  }
  // Ids on a bus differ, and with them the ticks in which their drives are asked.
  if (stage_ == Stage::failed || tick_ % kTicksPerQuestion != drive_id_ % kTicksPerQuestion) return std::nullopt;
  if (tries_ == kTries) {
    fail(SetupFault::settings_unread, kAsked[asked_]);
    return std::nullopt;
  }
  ++tries_;
  return encode_damiao_question(drive_id_, kAsked[asked_]);
}

void DamiaoReadback::take(const DamiaoAnswer& answer) noexcept {
  // A second answer to a question that was repeated tells nothing new.
  if (stage_ != Stage::asking || answer.which != kAsked[asked_] || tries_ == 0) return;
  if (!agrees(answer)) {
    fail(SetupFault::settings_differ, answer.which);
    return;
  }
  if (answer.which == DamiaoRegister::timeout) timeout_ = answer.value;
  tries_ = 0;
  if (++asked_ < kAsked.size()) return;
  stage_ = Stage::agreed;
  error_code_ = 0;
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
    case DamiaoRegister::timeout:
      return true;
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
  }
  return "";
}

}  // namespace takt::drivers
