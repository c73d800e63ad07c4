// A drive that speaks the MIT protocol, seen from the bus: the other half of drivers/mit_codec, written from the
// protocol's facts alone, so that the two check each other.
//
// Every 8-byte frame with its id is answered before it is obeyed: the reply tells the state as it was. Seven FF and a
// code are special: FC enters motor mode, FD leaves it, FE makes the present position zero, FB clears an error
// (Damiao). state        entered by                                   torque Damiao status disabled     start, FD, FB
// after an error                 none; holding brake engaged                 0 enabled      FC while disabled kp (p -
// q) + kd (v - dq) + t, clamped       1 lost         enabled, no motion command for `watchdog`    none; windings
// shorted: kLostDamping        D error        inject_error()                               none; holding brake engaged
// the code A T-Motor drive has no word for `lost` in its reply; FD and FC bring it back. The spring-applied brake is an
// assumption of this simulator: an arm without one falls whenever it is not enabled. Units: motor side, rad, rad/s, Nm.
// Pure, virtual time. Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <optional>

#include "config/robot_config.hpp"
#include "drivers/can_bus.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::plant {

struct MotorReading {
  double position = 0, velocity = 0;
};

class MitDrive {
 public:
  enum class State : std::uint8_t { disabled, enabled, lost, error };
  // A motor with shorted windings brakes softly.
  static constexpr double kLostDamping = 1.0;  // Nm s/rad

  MitDrive(const config::Drive& drive, Duration watchdog);

  // The frame's answer, if it is for this drive.
  std::optional<drivers::CanFrame> receive(const drivers::CanFrame& frame, MonoTime now);
  // Torque for the next step, from the encoder as read now. Runs the watchdog and the thermal model.
  double update(MotorReading reading, MonoTime now, Duration step);

  [[nodiscard]] State state() const { return state_; }
  [[nodiscard]] bool brake_engaged() const { return state_ == State::disabled || state_ == State::error; }

  // Faults. `code`: a Damiao error, 8..E; stays until FB. A silent drive obeys but does not answer.
  void inject_error(std::uint8_t code);
  void set_silent(bool silent) { silent_ = silent; }

 private:
  struct Command {
    double p = 0, v = 0, kp = 0, kd = 0, t = 0;
  };
  void obey(const drivers::CanFrame& frame, MonoTime now);
  void obey_special(std::uint8_t code, MonoTime now);
  [[nodiscard]] Command unpack(const std::uint8_t* data) const;
  [[nodiscard]] drivers::CanFrame report() const;
  [[nodiscard]] std::uint8_t status() const;

  config::Drive drive_;
  bool damiao_;
  Duration watchdog_;
  State state_ = State::disabled;
  std::uint8_t error_ = 0;
  bool silent_ = false;
  Command command_;
  MonoTime commanded_at_;
  MotorReading reading_;  // as reported: relative to the zero that was set
  double zero_ = 0;
  double torque_ = 0;
  double winding_C_;
};

}  // namespace takt::plant
