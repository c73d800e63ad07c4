// SPDX-License-Identifier: Apache-2.0
// A drive that speaks the MIT protocol.
//
// Every 8-byte frame with its id is answered before it is obeyed: the reply tells the state as it was. Seven FF and a
// code are special: FC enters motor mode, FD leaves it, FE makes the present position zero, FB clears an error
// (Damiao). Enabled, the torque is kp (p - q) + kd (v - dq) + t; Damiao reports its state as 0 disabled, 1 enabled,
// D lost, else an error's code. A T-Motor drive has no word for them in its 6 bytes; there FD and FC bring a lost one
// back. A RobStride tells no state either, has 8 bytes (the last two a temperature in 0.1 deg C), and takes six FF for
// special, of which the seventh byte may say more. The watchdog counts motion commands only. A Damiao drive has
// registers besides (damiao_register_file.hpp), which hold what its fields span, its control mode and its watchdog's
// time: it obeys motion commands in mode 1 only. With its supply it forgets of its place what position_after_power_up
// says; the zero that was set stays.
#pragma once

#include "simulation/damiao_register_file.hpp"
#include "simulation/device.hpp"

namespace takt::simulation {

class MitDevice final : public Device {
 public:
  MitDevice(const config::Drive& drive, Duration watchdog);

  void receive(const drivers::CanFrame& frame, MonoTime now, Frames& out) override;
  double update(MotorReading reading, MonoTime now, Duration step, Frames& out) override;
  [[nodiscard]] DeviceState state() const override { return state_; }
  bool inject(DeviceFault fault) override;
  void power_cycle(MonoTime now) override;

 private:
  struct Command {
    double p = 0, v = 0, kp = 0, kd = 0, t = 0;
  };
  void forget_place(double position);
  void obey(const drivers::CanFrame& frame, MonoTime now);
  void obey_special(std::uint8_t code, MonoTime now);
  [[nodiscard]] Command unpack(std::uint64_t word) const;
  void answer_register(const drivers::CanFrame& frame, Frames& out);
  [[nodiscard]] bool obeys_motion() const;
  [[nodiscard]] bool is_silent_for_too_long(MonoTime now) const;
  [[nodiscard]] bool is_for_us(const drivers::CanFrame& frame) const;
  drivers::CanFrame& reply(Frames& out, std::uint8_t length) const;  // its bytes are zero
  void report(Frames& out) const;
  void add_temperatures(drivers::CanFrame& frame) const;
  [[nodiscard]] std::uint8_t status() const;

  std::uint32_t id_, reply_id_;
  bool damiao_, robstride_, fd_;
  double kp_range_, kd_range_, torque_range_;
  config::PositionAfterPowerUp worth_;
  double place_step_;  // rad, between places that its encoder cannot tell apart after power-on, if there are such
  DeviceState state_ = DeviceState::disabled;
  std::uint8_t error_ = 0;
  Command command_;
  MonoTime commanded_at_, booted_at_;
  MotorReading reading_;  // as reported: relative to the zero that was set
  double zero_ = 0;
  bool knows_place_ = false;  // since power-on
  double torque_ = 0;
  Winding winding_;
  DamiaoRegisterFile registers_;  // the others' never change
};

}  // namespace takt::simulation
