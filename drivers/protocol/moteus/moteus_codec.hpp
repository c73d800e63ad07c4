// SPDX-License-Identifier: Apache-2.0
// moteus register protocol, host side: subframes that write and read registers, and replies, in one CAN FD frame. Pure.
//
// Id = (source | 0x80 when a reply is wanted) << 8 | destination; we are source 0. A subframe is type | count (1..3 in
// the low two bits, else a varuint), start register as varuint, then little-endian values: write 00/04/08/0C, read
// 10/14/18/1C, reply 20/24/28/2C for int8/16/32/float. 30 and 31 report an error, 50 is padding up to a legal length.
// Integers are steps of a size that depends on the register's quantity; the most negative one means "no value", as NaN
// does. This header speaks physical units: revolutions, rev/s, Nm, s, deg C, and 0..1 for gain scales.
// Sources: mjbots/moteus docs/protocol/can.md, docs/protocol/registers.md; mjbots/mjlib mjlib/multiplex/format.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/bus/can_bus.hpp"

namespace takt::drivers {

enum class MoteusType : std::uint8_t { int8, int16, int32, float32 };

enum class MoteusRegister : std::uint16_t {
  mode = 0x000,
  position = 0x001,
  velocity = 0x002,
  torque = 0x003,
  q_current = 0x004,
  d_current = 0x005,
  absolute_position = 0x006,
  power = 0x007,
  motor_temperature = 0x00A,
  home_state = 0x00C,
  voltage = 0x00D,
  temperature = 0x00E,
  fault = 0x00F,
  command_position = 0x020,
  command_velocity = 0x021,
  feedforward_torque = 0x022,
  kp_scale = 0x023,
  kd_scale = 0x024,
  maximum_torque = 0x025,
  stop_position = 0x026,
  watchdog_timeout = 0x027,
  velocity_limit = 0x028,
  acceleration_limit = 0x029,
  model_number = 0x100,
  firmware_version = 0x101,  // a byte each: 0x010304 is 1.3.4
  serial_number = 0x120      // three words, the least significant first
};

// Values of register 000.
inline constexpr std::uint8_t kMoteusStopped = 0, kMoteusFault = 1, kMoteusPosition = 10, kMoteusTimeout = 11;

// What one integer step of this register is worth: 1 for plain numbers (mode, fault) and for registers not named above.
double moteus_step(std::uint32_t reg, MoteusType type) noexcept;

// The shortest legal FD payload that holds `bytes` (0..64).
std::size_t fd_length(std::size_t bytes) noexcept;

class MoteusWriter {
 public:
  // Precondition: at most 64 bytes.
  explicit MoteusWriter(std::span<std::uint8_t> out) noexcept : out_(out) {}
  // Consecutive registers from `first`. Integers round, and saturate short of the most negative; NaN becomes that one.
  // False: no room, nothing was written. Precondition: at least one value.
  bool write(MoteusType type, MoteusRegister first, std::span<const float> values) noexcept;
  bool read(MoteusType type, MoteusRegister first, std::size_t count) noexcept;
  // Pads; returns the payload's length.
  std::size_t finish() noexcept;

 private:
  bool begin(std::uint8_t kind, MoteusType type, MoteusRegister first, std::size_t count, std::size_t bytes) noexcept;
  std::span<std::uint8_t> out_;
  std::size_t size_ = 0;
};

// Takes a reply apart, register by register.
class MoteusReader {
 public:
  struct Value {
    std::uint32_t reg = 0;
    float value = 0;            // physical units; NaN: the drive has no value
    std::uint32_t integer = 0;  // of int32: its bits, which a float has no room for
  };
  explicit MoteusReader(std::span<const std::uint8_t> bytes) noexcept : bytes_(bytes) {}
  // False: the end, or what follows is no reply. (Not an optional: returning one costs as much as reading the value.)
  bool next(Value& value) noexcept;
  // Meaningful when next() was false.
  [[nodiscard]] bool malformed() const noexcept { return malformed_; }
  [[nodiscard]] std::size_t reported_errors() const noexcept { return reported_errors_; }

 private:
  bool begin_subframe() noexcept;
  bool begin_reply(std::uint8_t head) noexcept;
  bool varuint(std::uint32_t& value) noexcept;

  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  MoteusType type_ = MoteusType::int8;
  std::uint32_t reg_ = 0, left_ = 0;
  std::size_t reported_errors_ = 0;
  bool malformed_ = false;
};

}  // namespace takt::drivers
