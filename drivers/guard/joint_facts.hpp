// SPDX-License-Identifier: Apache-2.0
// What the guard knows of one joint, computed once from the robot file, and what a frame asks of its drive. Joint side:
// rad, rad/s, Nm, Nm/rad, Nm s/rad.
#pragma once

#include <cstddef>
#include <cstdint>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::drivers::guard {

// What a frame that pushes says, and with it what can be judged.
enum class Law : std::uint8_t {
  fields,    // an impedance setpoint
  torque,    // a finished torque
  velocity,  // the drive's own velocity loop
  position,  // the drive's own position loop
};

struct Motion {
  float q = 0, dq = 0, kp = 0, kd = 0, tau = 0;
};

struct JointFacts {
  config::DriveProtocol protocol = config::DriveProtocol::mit;
  config::Cia402Mode mode = config::Cia402Mode::cst;
  Law law = Law::fields;
  bool damiao = false;
  bool fd = false;  // mit: frames are CAN FD
  std::uint32_t id = 0, host = 0;
  std::size_t bus = 0;
  // limits
  float q_low = 0, q_high = 0;  // margins included
  float velocity = 0, torque = 0, torque_step = 0, kp = 0, kd = 0;
  float position_step = 0;  // rad, at the velocity limit in one period
  float velocity_hard = 0;  // rad/s, faster than that no joint is left alone
  float damping = 0;
  // drive side, as the protocol needs them
  float ratio = 1, offset = 0;  // q_joint = q_motor / ratio + offset; ratio has the direction's sign
  Motion range;                 // packed fields span +-this, gains 0 to this
  float servo_kp = 0, servo_kd = 0;
  float torque_range = 0, torque_per_mille = 0;
  double rad_per_count = 0, rad_s_per_count = 0;
  double following_window = 0;  // rad of the motor that a drive may be told to be off its target; 0: none may be told
  std::uint32_t following_timeout_ms = 0;
  Duration shortest_watchdog;
  // Object 60C2: value * 10^exponent seconds, as its bytes; 0: the period has no such form.
  std::uint8_t interpolation_value = 0, interpolation_exponent = 0;
  // How far apart what was decided and what the wire says may lie.
  Motion rounding;
};

JointFacts facts_of(const config::RobotConfig& robot, std::size_t joint);

struct Demand {
  enum class Kind : std::uint8_t {
    unknown,    // nothing that we ever say to this drive
    aside,      // a question, a synchronisation, a mode that we always use
    disable,    // switches off, or clears errors
    energise,   // switches on
    configure,  // changes settings
    drive,      // `motion`
  };
  Kind kind = Kind::unknown;
  Motion motion{};        // what the law has no place for is 0
  float torque_most = 0;  // the frame's own limit; 0: it has none
  Duration valid_for{};   // how long the drive will obey; 0: the frame does not say
};

// What the last frame that drove the joint told its drive.
struct LastTold {
  float torque = 0;
  float doubt = 0;            // of it
  bool is_passive = true;     // it asked for nothing
  float q = 0;                // of a drive with a position loop of its own
  bool has_position = false;  // such a drive was told one since it was off
};

}  // namespace takt::drivers::guard
