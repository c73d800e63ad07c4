// SPDX-License-Identifier: Apache-2.0
// A drive that speaks the private protocol of RobStride and CyberGear.
//
// Frames with 29-bit ids and its number as target are obeyed, then answered: with feedback (motion 1, enable 3, stop 4,
// set zero 6, write 18), its identity (0), or a parameter (17). Stopped by its watchdog it reports reset mode and no
// fault, and takes the next enable. The watchdog's time, in units of 50 us, 0: off, stands in parameter 7028 and is 0
// after every power-on; a CyberGear (by the drive's model) has 200C instead, which keeps what the constructor was
// given. Asked for a parameter that it does not have, a CyberGear says nothing, another answers that the reading
// failed. Motion commands and enabling feed it, telemetry does not. An error is reported once by itself (21) as well.
// Everything written is lost at power-off, the zero included unless a save (22) followed it, which a CyberGear does not
// know. Of its place it forgets what position_after_power_up says; of one within a turn, parameter 7029 says which turn
// it begins in: 0, as delivered, 0 to 2 pi; 1, as an absolute one needs it, -pi to pi. Only run mode 0 moves. Source:
// belovictor/cybergear-docs instructionmanual/instructionmanual.md, section 4; for 7028 and failed readings the makers'
// manuals of RS00 to RS06;
// for 7029 motorbridge.seeedstudio.com reference/robstride-parameter-tables.
#pragma once

#include <map>
#include <optional>

#include "simulation/device.hpp"

namespace takt::simulation {

class RobstrideDevice final : public Device {
 public:
  RobstrideDevice(const config::Drive& drive, Duration watchdog);

  void receive(const drivers::CanFrame& frame, MonoTime now, Frames& out) override;
  double update(MotorReading reading, MonoTime now, Duration step, Frames& out) override;
  [[nodiscard]] DeviceState state() const override { return state_; }
  bool inject(DeviceFault fault) override;
  void power_cycle(MonoTime now) override;

 private:
  struct Command {
    double p = 0, v = 0, kp = 0, kd = 0, t = 0;
  };
  void start_up();
  void forget_place(double position);
  void move(const drivers::CanFrame& frame, MonoTime now);
  void enable(MonoTime now);
  void stop(bool clear_faults);
  void set_zero();
  void write(const drivers::CanFrame& frame);
  void save(const drivers::CanFrame& frame);
  [[nodiscard]] double wanted_torque() const;
  [[nodiscard]] std::optional<std::uint32_t> parameter(std::uint16_t index) const;
  [[nodiscard]] bool is_silent_for_too_long(MonoTime now) const;
  [[nodiscard]] drivers::CanFrame feedback() const;
  [[nodiscard]] drivers::CanFrame identity() const;
  [[nodiscard]] drivers::CanFrame answer(std::uint16_t index, std::uint32_t value) const;
  [[nodiscard]] drivers::CanFrame refusal(std::uint16_t index) const;
  [[nodiscard]] drivers::CanFrame fault_report() const;
  [[nodiscard]] bool is_cybergear() const { return drive_.model == "CyberGear"; }

  config::Drive drive_;
  Duration watchdog_;
  DeviceState state_ = DeviceState::disabled;
  unsigned host_;                                   // who asked last
  std::map<std::uint16_t, std::uint32_t> written_;  // parameters that can be written, as bits
  std::uint8_t faults_ = 0;
  bool report_due_ = false;
  Command command_;
  MonoTime commanded_at_, booted_at_;
  MotorReading reading_;  // as reported: relative to the zero that was set
  double zero_ = 0;
  double saved_zero_ = 0;  // what it begins with after power-on, as the next one
  std::uint32_t saved_zero_state_;
  bool knows_place_ = false;  // since power-on
  double torque_ = 0;
  Winding winding_;
};

}  // namespace takt::simulation
