// SPDX-License-Identifier: Apache-2.0
// An ODrive with firmware 0.6 that speaks CANSimple, as a drive that was set up for this host.
//
// It broadcasts by itself: encoder estimates every millisecond, heartbeat and torques every 10 ms, temperatures, errors
// and bus voltage every 100 ms. One question is answered: a remote frame of message 00 (version). Heard are: axis state
// 1 (idle) and 8 (closed loop; refused while an error is active), controller mode, input torque, clear errors,
// emergency stop, absolute position. A drive whose place is unknown after power-up counts from where it was switched
// on. In closed loop with torque control and passthrough it applies the input torque; in any other mode it applies
// none, so that a host that forgot to choose gets nowhere. Idle forgets the torque. Only input torques feed the
// watchdog; its expiry is an error like any other, and shows as `lost`. Supply on: position control, the factory's
// choice.
#pragma once

#include "simulation/device.hpp"

namespace takt::simulation {

class OdriveDevice final : public Device {
 public:
  OdriveDevice(const config::Drive& drive, Duration watchdog) : drive_(drive), watchdog_(watchdog) {}

  void receive(const drivers::CanFrame& frame, MonoTime now, Frames& out) override;
  double update(MotorReading reading, MonoTime now, Duration step, Frames& out) override;
  [[nodiscard]] DeviceState state() const override { return state_; }
  bool inject(DeviceFault fault) override;
  void power_cycle(MonoTime now) override;

 private:
  // True every `every`, beginning at the first call.
  struct Clockwork {
    Duration every;
    MonoTime next;
    bool strikes(MonoTime now);
  };
  void tell_version(Frames& out) const;
  void obey(std::uint32_t command, const drivers::CanFrame& frame, MonoTime now);
  void set_position(double here);
  void request_state(std::uint32_t state, MonoTime now);
  void fail(std::uint32_t error, DeviceState state);
  void say(std::uint32_t command, std::uint64_t low_to_high, Frames& out) const;
  void broadcast(MonoTime now, Frames& out);

  config::Drive drive_;
  Duration watchdog_;
  DeviceState state_ = DeviceState::disabled;
  std::uint32_t active_errors_ = 0, disarm_reason_ = 0;
  std::uint32_t control_mode_ = 3, input_mode_ = 1;
  float input_torque_ = 0;
  MonoTime commanded_at_, booted_at_;
  MotorReading reading_;          // as reported: relative to the origin
  std::optional<double> origin_;  // unset: was not turned on yet
  double torque_ = 0;
  Winding winding_;
  Clockwork estimates_{milliseconds(1), {}}, often_{milliseconds(10), {}}, seldom_{milliseconds(100), {}};
};

}  // namespace takt::simulation
