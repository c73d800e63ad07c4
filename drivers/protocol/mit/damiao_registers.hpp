// SPDX-License-Identifier: Apache-2.0
// A Damiao drive's own settings, asked for before it may be enabled: a packed range that differs from the robot file's
// scales every command, and another control mode does not obey MIT commands at all. Pure.
//
// The time-out is not only read: what the robot needs is written first, into memory that forgets it with the supply, so
// that no drive is trusted to have been set up by hand.
//
// Question: id 0x7FF, [drive low, drive high, 0x33, register, 0 0 0 0]; order: the same with 0x55 and the value in
// bytes 4..7, low byte first. Answer to both on the master id: the same with the present value. Feedback comes on that
// id too, and looks like an answer only at one position code, near the end of the range, at a speed near the range's
// end: losing that report is the price. Source: enactic/openarm_can dm_motor_control.cpp, dm_motor_constants.hpp.
#pragma once

#include <cstdint>
#include <optional>

#include "drivers/protocol/joint_driver.hpp"
#include "drivers/protocol/mit/mit_codec.hpp"

namespace takt::drivers {

inline constexpr std::uint32_t kDamiaoRegisterId = 0x7FF;

// Values of the protocol, in the order in which they are asked.
enum class DamiaoRegister : std::uint8_t {
  control_mode = 10,  // u32; 1: MIT
  p_max = 21,         // float32, rad
  v_max = 22,         // float32, rad/s
  t_max = 23,         // float32, Nm
  hardware = 13,      // u32, as the three below
  firmware = 14,      // also called sw_ver
  serial_number = 15,
  bit_rate = 35,  // u32, a code (bit_rate_code); asked of a drive that speaks CAN FD
  timeout = 9,    // u32, in units of 50 us; 0: off
};

struct DamiaoAnswer {
  DamiaoRegister which = DamiaoRegister::timeout;
  std::uint32_t value = 0;  // its bits
  bool to_question = true;  // false: to an order
};

CanFrame encode_damiao_question(std::uint32_t drive_id, DamiaoRegister which) noexcept;
// Lost at power-off.
CanFrame encode_damiao_order(std::uint32_t drive_id, DamiaoRegister which, std::uint32_t value) noexcept;
// Nothing: not an answer of that drive about one of these registers, or not 8 bytes of classic data (`fd`: of CAN FD).
std::optional<DamiaoAnswer> decode_damiao_answer(std::uint32_t drive_id, const CanFrame& frame,
                                                 bool fd = false) noexcept;

// What register 35 (can_br) says of a drive whose data phase has this rate. 0: none is known. Sources:
// enactic/openarm_can setup/openarm-change-baudrate and setup/cli/commands/change_motor_baudrate_commands.cpp; the
// latter alone knows codes for 8 and 10 Mbit/s, so they are none here.
constexpr std::uint32_t damiao_bit_rate_code(std::uint32_t bits_per_s) {
  switch (bits_per_s) {
    case 2'000'000:
      return 5;
    case 2'500'000:
      return 6;
    case 3'200'000:
      return 7;
    case 4'000'000:
      return 8;
    case 5'000'000:
      return 9;
    default:
      return 0;
  }
}

// What must be true of the drive's own time-out before it may be enabled.
struct DriveTimeoutWish {
  std::uint32_t units = 0;  // written, then read back
  bool waived = false;      // the robot file allows it to be off or unknown
};

// What must be true of who the drive is; nothing: any drive may be there.
struct DamiaoIdentity {
  std::optional<std::uint32_t> firmware, serial_number;
};

// Asks each register in turn until the drive answers, and judges. Who it is (13 to 15) may stay unanswered where
// nothing is expected of it.
class DamiaoReadback {
 public:
  // `bit_rate`: the code that register 35 must have; 0: it is not asked.
  DamiaoReadback(std::uint32_t drive_id, const MitRange& expected, const DriveTimeoutWish& timeout,
                 const DamiaoIdentity& identity = {}, std::uint32_t bit_rate = 0) noexcept
      : drive_id_(drive_id), expected_(expected), wish_(timeout), identity_(identity), bit_rate_(bit_rate) {}

  // The question to send in this tick, if it is time for one. Call once per tick in which the drive is heard and
  // disabled. At most kTries per register; all over again kTicksToRetry later when something differed or stayed unread.
  std::optional<CanFrame> next() noexcept;
  // The drive may have forgotten: everything is asked again. Keeps error_code() until then.
  void restart() noexcept;
  void take(const DamiaoAnswer& answer) noexcept;
  // Everything was read, and agrees with the robot file.
  [[nodiscard]] bool may_enable() const { return stage_ == Stage::agreed; }
  // JointFeedback::error_code of the newest complete attempt, with the register's number; 0: none failed.
  [[nodiscard]] std::uint32_t error_code() const { return error_code_; }
  // The drive's own command watchdog as read last, in units of 50 us; 0: off.
  [[nodiscard]] std::optional<std::uint32_t> timeout() const { return timeout_; }

  static constexpr int kTries = 10;
  static constexpr std::uint32_t kTicksToRetry = 500;

 private:
  enum class Stage : std::uint8_t { asking, agreed, failed };
  void fail(SetupFault fault, DamiaoRegister which) noexcept;
  void agree() noexcept;
  void give_up() noexcept;
  void take_timeout(std::uint32_t units) noexcept;
  [[nodiscard]] bool agrees(const DamiaoAnswer& answer) const noexcept;
  [[nodiscard]] bool may_stay_unread(DamiaoRegister which) const noexcept;
  void next_register() noexcept;

  std::uint32_t drive_id_;
  MitRange expected_;
  DriveTimeoutWish wish_;
  DamiaoIdentity identity_;
  std::uint32_t bit_rate_;
  Stage stage_ = Stage::asking;
  std::size_t asked_ = 0;  // index of the register in question
  int tries_ = 0;
  bool ordered_ = false;  // the time-out, since it was asked for last
  std::uint32_t tick_ = 0;
  std::uint32_t error_code_ = 0;
  std::optional<std::uint32_t> timeout_;
};

// "torque range (register 23)"; empty: none of these.
const char* damiao_register_name(std::uint32_t number);

}  // namespace takt::drivers
