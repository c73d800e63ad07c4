// What an impedance command becomes for a drive that closes its own loops: one number per tick. Pure.
//
// mode  target                                                                 who decides the torque
// CST   kp (q - q_meas) + kd (dq - dq_meas) + tau, computed here, clamped to    the command, as with an MIT drive, one
//       torque_range                                                            bus round trip later
// CSP   q where kp > 0, else the measured position (no stiffness was asked      the drive's position loop: gains and
//       for)                                                                    feed-forward torque do not reach it
// CSV   dq + kp/kd (q - q_meas) where kd > 0, clamped to the velocity limit,    the drive's velocity loop; the ratio of
//       else 0                                                                  the gains sets how fast errors close
// With CSP and CSV, torque_range limits nothing: set the drive's own torque limit (6072). With CSP, damping alone is no
// brake; a damped stop comes out as "stay where you are, wherever that is".
// A setpoint that is not finite: zero torque, measured position, zero velocity.
// Units: motor side, rad, rad/s, Nm. Counts and per mille are rounded to the nearest and saturate. Counts are computed
// in double: a 32-bit count does not fit a float.
#pragma once

#include <cstdint>

#include "config/robot_config.hpp"
#include "drivers/protocol/joint_driver.hpp"

namespace takt::drivers::cia402 {

struct Scale {
  config::Cia402Mode mode = config::Cia402Mode::cst;
  double counts_per_turn = 1;       // > 0; velocity on the wire is counts/s
  float rated_torque = 1;           // Nm, > 0: 1000 per mille
  std::int16_t most_per_mille = 0;  // torque_range, rounded down
  float velocity_limit = 0;         // rad/s, CSV
};

struct Measured {
  std::int32_t counts = 0;
  float q = 0, dq = 0;  // motor side
};

double to_rad(double counts, const Scale& scale) noexcept;
// Precondition: rad is finite.
std::int32_t to_counts(double rad, const Scale& scale) noexcept;
float to_torque(std::int16_t per_mille, const Scale& scale) noexcept;

// Pushes nowhere: what a drive is told that shall not move yet.
std::int32_t resting_target(const Scale& scale, const Measured& measured) noexcept;
std::int32_t target_of(const Scale& scale, const DriveSetpoint& motor, const Measured& measured) noexcept;

}  // namespace takt::drivers::cia402
