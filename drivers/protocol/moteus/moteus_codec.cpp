// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/moteus/moteus_codec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "drivers/protocol/little_endian.hpp"

namespace takt::drivers {
namespace {

constexpr std::uint8_t kWrite = 0x00, kRead = 0x10, kReply = 0x20, kWriteError = 0x30, kReadError = 0x31, kNop = 0x50;

struct Steps {
  double int8 = 1, int16 = 1, int32 = 1;
};

constexpr Steps steps_named(std::uint32_t reg) noexcept {
  switch (static_cast<MoteusRegister>(reg)) {
    case MoteusRegister::position:
    case MoteusRegister::absolute_position:
    case MoteusRegister::command_position:
    case MoteusRegister::stop_position:
      return {0.01, 1e-4, 1e-5};
    case MoteusRegister::velocity:
    case MoteusRegister::command_velocity:
    case MoteusRegister::velocity_limit:
      return {0.1, 2.5e-4, 1e-5};
    case MoteusRegister::acceleration_limit:
      return {0.05, 1e-3, 1e-5};
    case MoteusRegister::torque:
    case MoteusRegister::feedforward_torque:
    case MoteusRegister::maximum_torque:
      return {0.5, 0.01, 1e-3};
    case MoteusRegister::q_current:
    case MoteusRegister::d_current:
      return {1, 0.1, 1e-3};
    case MoteusRegister::power:
      return {10, 0.05, 1e-4};
    case MoteusRegister::motor_temperature:
    case MoteusRegister::temperature:
      return {1, 0.1, 1e-3};
    case MoteusRegister::voltage:
      return {0.5, 0.1, 1e-3};
    case MoteusRegister::kp_scale:
    case MoteusRegister::kd_scale:
      return {1.0 / 127, 1.0 / 32767, 1.0 / 2147483647};
    case MoteusRegister::watchdog_timeout:
      return {0.01, 1e-3, 1e-6};
    case MoteusRegister::mode:
    case MoteusRegister::home_state:
    case MoteusRegister::fault:
    case MoteusRegister::model_number:
    case MoteusRegister::firmware_version:
    case MoteusRegister::serial_number:
      break;
  }
  return {};
}

// The same as a table: looked up eight times per reply.
constexpr auto kSteps = [] {
  std::array<std::array<double, 4>, 0x2A> table{};  // by register and MoteusType
  for (std::uint32_t reg = 0; reg < table.size(); ++reg) {
    const Steps steps = steps_named(reg);
    table[reg] = {steps.int8, steps.int16, steps.int32, 1};
  }
  return table;
}();

constexpr std::size_t size_of(MoteusType type) noexcept {
  switch (type) {
    case MoteusType::int8:
      return 1;
    case MoteusType::int16:
      return 2;
    case MoteusType::int32:
    case MoteusType::float32:
      return 4;
  }
  return 4;
}

template <typename Int>
Int to_steps(float value, double step) noexcept {
  constexpr double kMost = std::numeric_limits<Int>::max();
  if (std::isnan(value)) return std::numeric_limits<Int>::min();
  return static_cast<Int>(std::clamp(std::round(static_cast<double>(value) / step), -kMost, kMost));
}

template <typename Int>
float from_steps(Int steps, double step) noexcept {
  if (steps == std::numeric_limits<Int>::min()) return std::numeric_limits<float>::quiet_NaN();
  return static_cast<float>(static_cast<double>(steps) * step);
}

void put(std::uint8_t* at, MoteusType type, std::uint32_t reg, float value) noexcept {
  const double step = moteus_step(reg, type);
  switch (type) {
    case MoteusType::int8:
      at[0] = static_cast<std::uint8_t>(to_steps<std::int8_t>(value, step));
      break;
    case MoteusType::int16:
      put_u16(at, static_cast<std::uint16_t>(to_steps<std::int16_t>(value, step)));
      break;
    case MoteusType::int32:
      put_u32(at, static_cast<std::uint32_t>(to_steps<std::int32_t>(value, step)));
      break;
    case MoteusType::float32:
      put_f32(at, value);
      break;
  }
}

float get(const std::uint8_t* at, MoteusType type, std::uint32_t reg) noexcept {
  if (type == MoteusType::float32) return get_f32(at);  // the usual case: no step to look up
  const double step = moteus_step(reg, type);
  switch (type) {
    case MoteusType::int8:
      return from_steps(static_cast<std::int8_t>(at[0]), step);
    case MoteusType::int16:
      return from_steps(static_cast<std::int16_t>(get_u16(at)), step);
    case MoteusType::int32:
      return from_steps(static_cast<std::int32_t>(get_u32(at)), step);
    case MoteusType::float32:
      break;
  }
  return 0;
}

}  // namespace

double moteus_step(std::uint32_t reg, MoteusType type) noexcept {
  return reg < kSteps.size() ? kSteps[reg][static_cast<std::size_t>(type)] : 1;
}

std::size_t fd_length(std::size_t bytes) noexcept {
  constexpr std::array<std::size_t, 7> kLegal{12, 16, 20, 24, 32, 48, 64};
  if (bytes <= 8) return bytes;
  for (const std::size_t legal : kLegal)
    if (bytes <= legal) return legal;
  return kLegal.back();
}

// Room for head, count, start register (a byte for each seven bits) and `bytes` of values?
bool MoteusWriter::begin(std::uint8_t kind, MoteusType type, MoteusRegister first, std::size_t count,
                         std::size_t bytes) noexcept {
  const auto start = static_cast<std::uint32_t>(first);
  const std::size_t head = (count <= 3 ? 1U : 2U) + (start < 0x80 ? 1U : 2U);
  if (count == 0 || count > 127 || size_ + head + bytes > out_.size()) return false;
  const auto kind_and_type = static_cast<std::uint8_t>(kind | static_cast<unsigned>(type) << 2U);
  const auto short_count = static_cast<std::uint8_t>(count);
  if (count <= 3) {
    out_[size_++] = static_cast<std::uint8_t>(kind_and_type | short_count);
  } else {
    out_[size_++] = kind_and_type;
    out_[size_++] = short_count;
  }
  if (start >= 0x80) out_[size_++] = static_cast<std::uint8_t>(0x80U | (start & 0x7FU));
  out_[size_++] = static_cast<std::uint8_t>(start < 0x80 ? start : start >> 7U);
  return true;
}

bool MoteusWriter::write(MoteusType type, MoteusRegister first, std::span<const float> values) noexcept {
  const std::size_t each = size_of(type);
  if (!begin(kWrite, type, first, values.size(), values.size() * each)) return false;
  auto reg = static_cast<std::uint32_t>(first);
  for (const float value : values) {
    put(&out_[size_], type, reg++, value);
    size_ += each;
  }
  return true;
}

bool MoteusWriter::read(MoteusType type, MoteusRegister first, std::size_t count) noexcept {
  return begin(kRead, type, first, count, 0);
}

std::size_t MoteusWriter::finish() noexcept {
  const std::size_t length = std::min(fd_length(size_), out_.size());
  while (size_ < length) out_[size_++] = kNop;
  return size_;
}

bool MoteusReader::next(Value& value) noexcept {
  while (left_ == 0)
    if (malformed_ || at_ == bytes_.size() || !begin_subframe()) return false;
  value.reg = reg_;
  value.value = get(&bytes_[at_], type_, reg_);
  value.integer = type_ == MoteusType::int32 ? get_u32(&bytes_[at_]) : 0;
  at_ += size_of(type_);
  ++reg_;
  --left_;
  return true;
}

// Consumes at least one byte.
bool MoteusReader::begin_subframe() noexcept {
  const std::uint8_t head = bytes_[at_++];
  if (head == kNop) return true;
  if (head == kWriteError || head == kReadError) {
    ++reported_errors_;
    std::uint32_t reg = 0, error = 0;
    malformed_ = malformed_ || !varuint(reg) || !varuint(error);
    return !malformed_;
  }
  if ((head & 0xF0U) == kReply) return begin_reply(head);
  malformed_ = true;
  return false;
}

bool MoteusReader::begin_reply(std::uint8_t head) noexcept {
  std::uint32_t count = head & 3U;
  type_ = static_cast<MoteusType>(head >> 2U & 3U);
  malformed_ = (count == 0 && !varuint(count)) || !varuint(reg_);
  const std::size_t room = bytes_.size() - at_;
  malformed_ = malformed_ || count > room || count * size_of(type_) > room;
  left_ = malformed_ ? 0 : count;
  return !malformed_;
}

// At most five bytes of seven bits; what does not fit into 32 bits is none.
bool MoteusReader::varuint(std::uint32_t& value) noexcept {
  std::uint64_t sum = 0;
  for (unsigned shift = 0; shift < 35 && at_ < bytes_.size(); shift += 7) {
    const std::uint8_t byte = bytes_[at_++];
    sum |= std::uint64_t{byte & 0x7FU} << shift;
    if ((byte & 0x80U) != 0) continue;
    value = static_cast<std::uint32_t>(sum);
    return sum <= 0xFFFF'FFFFU;
  }
  return false;
}

}  // namespace takt::drivers
