// SPDX-License-Identifier: Apache-2.0
// The last word before encoding, written without any of the stages' code: whatever they did, what leaves is finite,
// inside every limit, and produces no more than the torque limit at the measured state. Positions may lie in the hard
// margin: where a joint that was found there is left, or returns from.
//
// It acts only if an earlier stage has a fault; then the setpoint becomes a pure torque, or nothing if not finite.
#pragma once

#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

enum class EnvelopeVerdict : std::uint8_t { inside, clamped, not_finite };

inline constexpr float kTorqueRounding = 1.0e-3F;  // of the torque limit: tolerated rounding of the predicted torque

// q, dq: measured state in rad and rad/s. Afterwards `tau_total` is the torque the drive will produce there.
EnvelopeVerdict clamp_to_envelope(JointSetpoint& setpoint, float& tau_total, float q, float dq,
                                  const JointLimits& limits);

}  // namespace takt::pipeline
