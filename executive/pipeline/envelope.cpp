// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/envelope.hpp"

#include <cmath>

namespace takt::pipeline {
namespace {

float limited(float value, float low, float high) {
  return value < low ? low : (value > high ? high : value);
}

bool is_inside(const JointSetpoint& s, float total, const JointLimits& limits) {
  return s.q >= limits.q_min - limits.q_hard_margin && s.q <= limits.q_max + limits.q_hard_margin &&
         std::abs(s.dq) <= limits.velocity && s.kp >= 0.0F && s.kp <= limits.kp_max && s.kd >= 0.0F &&
         s.kd <= limits.kd_max && std::abs(s.tau) <= limits.torque &&
         std::abs(total) <= limits.torque * (1.0F + kTorqueRounding);
}

}  // namespace

EnvelopeVerdict clamp_to_envelope(JointSetpoint& setpoint, float& tau_total, float q, float dq,
                                  const JointLimits& limits) {
  const float total = setpoint.kp * (setpoint.q - q) + setpoint.kd * (setpoint.dq - dq) + setpoint.tau;
  const float sum = setpoint.q + setpoint.dq + setpoint.kp + setpoint.kd + setpoint.tau + total + q + dq;
  if (!std::isfinite(sum)) {
    setpoint = {};
    tau_total = 0.0F;
    return EnvelopeVerdict::not_finite;
  }
  tau_total = total;
  if (is_inside(setpoint, total, limits)) return EnvelopeVerdict::inside;
  tau_total = limited(total, -limits.torque, limits.torque);
  setpoint = {limited(setpoint.q, limits.q_min - limits.q_hard_margin, limits.q_max + limits.q_hard_margin), 0.0F, 0.0F,
              0.0F, tau_total};
  return EnvelopeVerdict::clamped;
}

}  // namespace takt::pipeline
