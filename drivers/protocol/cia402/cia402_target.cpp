// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/cia402/cia402_target.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace takt::drivers::cia402 {
namespace {

std::int32_t to_per_mille(float torque, const Scale& scale) noexcept {
  constexpr auto kMost = static_cast<float>(kMostPerMille);
  return static_cast<std::int32_t>(std::lround(std::clamp(torque / scale.rated_torque * 1000.0F, -kMost, kMost)));
}

std::int32_t whole(double counts) noexcept {
  using Limits = std::numeric_limits<std::int32_t>;
  return static_cast<std::int32_t>(
      std::clamp(std::round(counts), static_cast<double>(Limits::min()), static_cast<double>(Limits::max())));
}

}  // namespace

double to_rad(double counts, const Scale& scale) noexcept {
  return counts * (2 * std::numbers::pi / scale.counts_per_turn);
}

std::int32_t to_counts(double rad, const Scale& scale) noexcept {
  return whole(rad / (2 * std::numbers::pi) * scale.counts_per_turn);
}

std::int32_t to_speed_counts(double rad_s, const Scale& scale) noexcept {
  return whole(rad_s / (2 * std::numbers::pi) * scale.speed_counts);
}

float to_torque(std::int16_t per_mille, const Scale& scale) noexcept {
  return static_cast<float>(per_mille) * scale.rated_torque / 1000.0F;
}

std::int32_t resting_target(const Scale& scale, std::int32_t counts) noexcept {
  return scale.mode == config::Cia402Mode::csp ? counts : 0;
}

std::int32_t target_of(const Scale& scale, const DriveSetpoint& motor, std::int32_t counts) noexcept {
  if (!is_finite(motor)) return resting_target(scale, counts);
  switch (scale.mode) {
    case config::Cia402Mode::csp:
      return motor.kp > 0 ? to_counts(motor.q, scale) : counts;
    case config::Cia402Mode::csv:
      return to_speed_counts(motor.dq, scale);
    case config::Cia402Mode::cst:
      return to_per_mille(motor.tau, scale);
  }
  return 0;
}

}  // namespace takt::drivers::cia402
