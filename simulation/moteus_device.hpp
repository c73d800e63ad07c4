// SPDX-License-Identifier: Apache-2.0
// A moteus controller behind its register protocol, over CAN FD.
//
// A frame's writes are obeyed in order, then its reads are answered in one frame, if the source asks for a reply. Mode
// comes first: 0 stops and clears, 10 starts a command whose other registers begin at their defaults; writes without a
// mode before them do nothing. In position mode the torque is the drive's own law with its own gains,
//   kp_scale servo_kp (p - q) + kd_scale servo_kd (v - dq) + feed-forward, within the commanded maximum,
// kd_scale held down to kp_scale, p advancing by v between commands, and no position (NaN) meaning the present one.
// The command's watchdog: 0 the drive's default, NaN none. When it expires the mode is 11, shown as `lost`: only mode 0
// leads out of it, and out of 1, a fault. Supply on: mode 0, and the home state (00C) that it was made with: 0
// relative, 1 the rotor's, 2 the output's; "set output exact" (131) makes it 2. Who it is: 100 model, 101 firmware (a
// byte each of major.minor.micro), 120 to 122 serial number, the least significant word first.
#pragma once

#include <cmath>
#include <optional>

#include "simulation/device.hpp"

namespace takt::simulation {

class MoteusDevice final : public Device {
 public:
  explicit MoteusDevice(const config::Drive& drive, Duration watchdog, int home_state_at_power_on = 2)
      : drive_(drive),
        default_watchdog_(watchdog),
        home_state_at_power_on_(home_state_at_power_on),
        home_state_(home_state_at_power_on) {}

  void receive(const drivers::CanFrame& frame, MonoTime now, Frames& out) override;
  double update(MotorReading reading, MonoTime now, Duration step, Frames& out) override;
  [[nodiscard]] DeviceState state() const override { return state_; }
  bool inject(DeviceFault fault) override;
  void power_cycle(MonoTime now) override;

 private:
  struct Command {
    double position = 0, velocity = 0, torque = 0, kp_scale = 1, kd_scale = 1;
    double max_torque = NAN, watchdog_s = 0;
  };
  class Bytes;  // of a frame being read
  bool obey(Bytes& bytes, drivers::CanFrame& reply, bool& mode_written);
  void write(unsigned reg, double value, bool& mode_written);
  void write_mode(int mode);
  [[nodiscard]] double read(unsigned reg) const;
  [[nodiscard]] double serial_word(unsigned place) const;
  void answer(unsigned type, unsigned first, unsigned count, drivers::CanFrame& reply) const;
  [[nodiscard]] double law() const;
  [[nodiscard]] double position() const { return reading_.position - zero_; }
  [[nodiscard]] Telling said() const { return tell({position(), reading_.velocity}, torque_); }
  [[nodiscard]] int mode() const;

  config::Drive drive_;
  Duration default_watchdog_;
  int home_state_at_power_on_, home_state_;
  double zero_ = 0;  // rad: where position reads 0
  DeviceState state_ = DeviceState::disabled;
  int fault_ = 0;
  Command command_;
  MonoTime commanded_at_, booted_at_;
  MotorReading reading_;
  double torque_ = 0;
  Winding winding_;
};

}  // namespace takt::simulation
