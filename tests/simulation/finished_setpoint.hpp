// SPDX-License-Identifier: Apache-2.0
// A setpoint as the tick would finish it for the drive that gets it: the pipeline's own law on the newest reading,
// without limits. For loops of drivers and devices that have no tick.
#pragma once

#include "drivers/protocol/joint_driver.hpp"
#include "executive/pipeline/stabiliser.hpp"
#include "executive/setup/tick_config_of.hpp"

namespace takt::test {

// `torque`, `velocity`: what the joint may be asked for at most, Nm and rad/s.
inline drivers::DriveSetpoint finished(const config::Drive& drive, const drivers::DriveSetpoint& wanted,
                                       const JointFeedback& reading, float torque = 1e6F, float velocity = 1e6F) {
  pipeline::JointConfig joint;
  setup::set_loop(drive, joint);
  joint.limits = {.q_min = -1e6F,
                  .q_max = 1e6F,
                  .velocity = velocity,
                  .acceleration = 1e6F,
                  .torque = torque,
                  .torque_rate = 1e9F,
                  .kp_max = 1e6F,
                  .kd_max = 1e6F,
                  .velocity_hard = 1e6F};
  const pipeline::JointSetpoint made = pipeline::stabilise_joint({.reference = {wanted.q, wanted.dq},
                                                                  .measured = {reading.q, reading.dq},
                                                                  .kp = wanted.kp,
                                                                  .kd = wanted.kd,
                                                                  .tau_ff = wanted.tau},
                                                                 joint, 1e-3F)
                                           .setpoint;
  return {made.q, made.dq, made.kp, made.kd, made.tau};
}

}  // namespace takt::test
