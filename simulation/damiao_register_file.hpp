// SPDX-License-Identifier: Apache-2.0
// The settings inside a simulated Damiao drive, and the questions and orders about them.
//
// On id 0x7FF, 8 bytes: drive number in two, low byte first, an operation (0x33 read, 0x55 write, 0xAA store, 0xCC
// refresh: report as for a command), the register's number, its value in four, low byte first. Answered with the same
// bytes and the present value; what it does not know it does not answer. Written values count at once and are gone
// after power-off unless stored. Neither is done while enabled. Sources: enactic/openarm_can dm_motor_control.cpp,
// dm_motor_constants.hpp (read, write, refresh, numbers); the store operation is the maker's.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::simulation {

// What packed fields span, +-.
struct MitSpans {
  double position = 0, velocity = 0, torque = 0;
};

class DamiaoRegisterFile {
 public:
  static constexpr std::uint32_t kBusId = 0x7FF;
  static constexpr std::uint8_t kRead = 0x33, kWrite = 0x55, kStore = 0xAA, kRefresh = 0xCC;
  static constexpr std::uint8_t kTimeout = 9, kControlMode = 10, kHardware = 13, kFirmware = 14, kSerialNumber = 15,
                                kPositionMax = 21, kVelocityMax = 22, kTorqueMax = 23, kBitRate = 35;

  // `watchdog`: what the time-out starts with, to 50 us. Who it is: as the robot file wants it, else a number made up.
  DamiaoRegisterFile(const config::Drive& drive, Duration watchdog);

  // False: no answer. Precondition: the frame names this drive.
  bool serve(std::span<const std::uint8_t, 8> order, bool enabled, std::span<std::uint8_t, 8> answer);
  // Supply off and on.
  void restart();
  [[nodiscard]] const MitSpans& spans() const { return spans_; }
  // Zero: off.
  [[nodiscard]] Duration watchdog() const { return watchdog_; }
  // Whether it obeys motion commands.
  [[nodiscard]] bool is_in_mit_mode() const { return is_in_mit_mode_; }

 private:
  using Registers = std::array<std::optional<std::uint32_t>, kBitRate + 1>;  // by number; empty: no such register
  void take_effect();

  MitSpans spans_;  // what present_ means, as are the next two
  Duration watchdog_;
  bool is_in_mit_mode_ = true;
  Registers present_, stored_;
};

}  // namespace takt::simulation
