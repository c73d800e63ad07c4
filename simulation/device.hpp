// SPDX-License-Identifier: Apache-2.0
// A drive as the bus sees it: the other half of a protocol, with a motor behind it. One class per protocol, written
// from the protocol's facts alone and without the host's codec, so that the two check each other.
//
// state      entered by                                   torque
// booting    power_cycle(), for kBootTime                 none, brake engaged; says nothing but its boot message
// disabled   end of boot, the protocol's disable          none, brake engaged
// enabled    the protocol's enable                        what the protocol commands, clamped to torque_range
// lost       the drive's own command watchdog ran out     windings shorted: brakes softly (kLostDamping)
// error      inject(), until the protocol's clear         none, brake engaged
// The spring-applied brake is an assumption of this simulator: an arm without one falls whenever it is not enabled.
// Units: motor side, rad, rad/s, Nm. Pure, virtual time. Thread rule: one thread at a time.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/bus/can_bus.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::simulation {

enum class DeviceState : std::uint8_t { booting, disabled, enabled, lost, error };

// Faults every drive can have; each protocol reports them with a code of its own.
enum class DeviceFault : std::uint8_t {
  over_temperature,
  over_current,
  over_voltage,
  under_voltage,
  encoder,
  overload
};

inline constexpr double kLostDamping = 1.0;  // Nm s/rad
inline constexpr Duration kBootTime = milliseconds(200);

struct MotorReading {
  double position = 0, velocity = 0;
};

// What a drive says of its motion: motor side, rad, rad/s, Nm.
struct Telling {
  double position = 0, velocity = 0, torque = 0;
};

// What is wrong with what a drive says, while it obeys by what is true. Positions, motor side, count from where the
// joint stood when it began.
struct FeedbackFaults {
  bool freeze = false;           // position, velocity and torque stay as they were
  bool frozen_position = false;  // the position stays; the rest is true
  bool reversed = false;         // the position goes the other way; the velocity is true
  double offset = 0;             // rad: the position is off by this much
  double scale = 1;              // the position goes this much further; the velocity is true
  bool operator==(const FeedbackFaults&) const = default;
};

using Frames = std::vector<drivers::CanFrame>;

class Device {
 public:
  virtual ~Device() = default;
  void set(const FeedbackFaults& faults) {
    if (faults != feedback_) since_.reset();
    feedback_ = faults;
  }
  // A frame that crossed the drive's bus, whichever drive it was for; answers are appended to `out`.
  virtual void receive(const drivers::CanFrame& frame, MonoTime now, Frames& out) = 0;
  // Torque for the next step, from the encoder as read now. Runs watchdog, boot and temperature; what the drive says by
  // itself (heartbeats, cyclic reports) is appended to `out`.
  virtual double update(MotorReading reading, MonoTime now, Duration step, Frames& out) = 0;
  [[nodiscard]] virtual DeviceState state() const = 0;
  // Raises the error as if the drive had found it. False: the protocol has no code for it.
  virtual bool inject(DeviceFault fault) = 0;
  // Supply off and on: everything that is not stored is forgotten.
  virtual void power_cycle(MonoTime now) = 0;
  [[nodiscard]] bool brake_engaged() const { return state() != DeviceState::enabled && state() != DeviceState::lost; }

 protected:
  // What the drive says while this is true.
  [[nodiscard]] Telling tell(const MotorReading& reading, double torque) const {
    const Telling truth{reading.position, reading.velocity, torque};
    if (feedback_ == FeedbackFaults{}) return truth;
    if (!since_) since_ = truth;
    if (feedback_.freeze) return *since_;
    const double scale = feedback_.frozen_position ? 0 : feedback_.reversed ? -feedback_.scale : feedback_.scale;
    const double moved = truth.position - since_->position;
    return {since_->position + scale * moved + feedback_.offset, truth.velocity, truth.torque};
  }

 private:
  FeedbackFaults feedback_;
  mutable std::optional<Telling> since_;  // what was true when the fault began
};

// What a motor's torque does to its winding's temperature.
class Winding {
 public:
  void update(double torque, double torque_range, Duration step) {
    const double share = torque / torque_range;
    winding_C_ += (kAmbient_C + kFullTorqueRise_C * share * share - winding_C_) * step.seconds() / kThermalTime_s;
  }
  [[nodiscard]] double winding_C() const { return winding_C_; }
  // The output stage stays cooler.
  [[nodiscard]] double stage_C() const { return (winding_C_ + kAmbient_C) / 2; }

 private:
  static constexpr double kAmbient_C = 25;
  static constexpr double kFullTorqueRise_C = 60;  // above ambient, at the torque range for ever
  static constexpr double kThermalTime_s = 40;
  double winding_C_ = kAmbient_C;
};

inline constexpr double kBusVoltage_V = 48;

}  // namespace takt::simulation
