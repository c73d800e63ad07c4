// The impedance law, computed on this side of the bus for drives that take a torque only. Pure, float32.
#pragma once

#include <algorithm>
#include <cmath>

#include "drivers/protocol/joint_driver.hpp"

namespace takt::drivers {

// kp (q - measured q) + kd (dq - measured dq) + tau, within +-limit (finite, > 0). Setpoint, measurement and limit are
// on the same side of the gear: rad, rad/s, Nm. Anything not finite on the way in or through: 0, which pushes nowhere.
inline float impedance_torque(const DriveSetpoint& setpoint, float q, float dq, float limit) noexcept {
  const float torque = setpoint.kp * (setpoint.q - q) + setpoint.kd * (setpoint.dq - dq) + setpoint.tau;
  return std::isfinite(torque) ? std::clamp(torque, -limit, limit) : 0.0F;
}

}  // namespace takt::drivers
