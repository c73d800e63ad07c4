// SPDX-License-Identifier: Apache-2.0
// What a setpoint becomes for a drive that closes its own loops: one number per tick. Pure.
//
// mode  target                                            who decides the torque
// CST   tau                                               the host, which has closed the loop: one bus round trip later
// CSP   q where kp > 0, else the measured position (no    the drive's position loop: gains and feed-forward torque do
//       stiffness was asked for)                          not reach it
// CSV   dq                                                the drive's velocity loop
// With CSP and CSV what is sent limits no torque: set-up gives the drive its own limit (6072). With CSP, damping alone
// is no brake; a damped stop comes out as "stay where you are, wherever that is". A setpoint that is not finite: zero
// torque, measured position, zero velocity. Units: motor side, rad, rad/s, Nm. Counts and per mille are rounded to the
// nearest and saturate at what the wire can say. Counts are computed in double: a 32-bit count does not fit a float.
#pragma once

#include <cstdint>

#include "config/robot_config.hpp"
#include "drivers/protocol/joint_driver.hpp"

namespace takt::drivers::cia402 {

struct Scale {
  config::Cia402Mode mode = config::Cia402Mode::cst;
  double counts_per_turn = 1;  // > 0, of object 6064
  double speed_counts = 1;     // > 0, of object 60FF, at one turn per second; csv
  float rated_torque = 1;      // Nm, > 0: 1000 per mille
};

inline constexpr int kMostPerMille = 32'767;  // object 6071 has 16 bits

double to_rad(double counts, const Scale& scale) noexcept;
// Precondition: rad is finite.
std::int32_t to_counts(double rad, const Scale& scale) noexcept;
// Counts of object 60FF. Precondition: rad_s is finite.
std::int32_t to_speed_counts(double rad_s, const Scale& scale) noexcept;
float to_torque(std::int16_t per_mille, const Scale& scale) noexcept;

// Pushes nowhere: what a drive is told that shall not move yet. `counts`: the measured position.
std::int32_t resting_target(const Scale& scale, std::int32_t counts) noexcept;
std::int32_t target_of(const Scale& scale, const DriveSetpoint& motor, std::int32_t counts) noexcept;

}  // namespace takt::drivers::cia402
