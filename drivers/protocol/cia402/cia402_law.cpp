#include "drivers/protocol/cia402/cia402_law.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace takt::drivers::cia402 {
namespace {

bool is_finite(const DriveSetpoint& s) noexcept {
  return std::isfinite(s.q) && std::isfinite(s.dq) && std::isfinite(s.kp) && std::isfinite(s.kd) &&
         std::isfinite(s.tau);
}

std::int32_t torque_target(const Scale& scale, const DriveSetpoint& s, const Measured& measured) noexcept {
  const float torque = s.kp * (s.q - measured.q) + s.kd * (s.dq - measured.dq) + s.tau;
  const float per_mille = torque / scale.rated_torque * 1000.0F;
  if (!std::isfinite(per_mille)) return 0;
  const float most = scale.most_per_mille;
  return static_cast<std::int32_t>(std::lround(std::clamp(per_mille, -most, most)));
}

std::int32_t velocity_target(const Scale& scale, const DriveSetpoint& s, const Measured& measured) noexcept {
  if (!(s.kd > 0)) return 0;
  const float velocity = s.dq + s.kp / s.kd * (s.q - measured.q);
  if (!std::isfinite(velocity)) return 0;
  return to_counts(std::clamp(velocity, -scale.velocity_limit, scale.velocity_limit), scale);
}

}  // namespace

double to_rad(double counts, const Scale& scale) noexcept {
  return counts * (2 * std::numbers::pi / scale.counts_per_turn);
}

std::int32_t to_counts(double rad, const Scale& scale) noexcept {
  using Limits = std::numeric_limits<std::int32_t>;
  const double counts = std::round(rad / (2 * std::numbers::pi) * scale.counts_per_turn);
  return static_cast<std::int32_t>(
      std::clamp(counts, static_cast<double>(Limits::min()), static_cast<double>(Limits::max())));
}

float to_torque(std::int16_t per_mille, const Scale& scale) noexcept {
  return static_cast<float>(per_mille) * scale.rated_torque / 1000.0F;
}

std::int32_t resting_target(const Scale& scale, const Measured& measured) noexcept {
  return scale.mode == config::Cia402Mode::csp ? measured.counts : 0;
}

std::int32_t target_of(const Scale& scale, const DriveSetpoint& motor, const Measured& measured) noexcept {
  if (!is_finite(motor)) return resting_target(scale, measured);
  switch (scale.mode) {
    case config::Cia402Mode::csp:
      return motor.kp > 0 ? to_counts(motor.q, scale) : measured.counts;
    case config::Cia402Mode::csv:
      return velocity_target(scale, motor, measured);
    case config::Cia402Mode::cst:
      return torque_target(scale, motor, measured);
  }
  return 0;
}

}  // namespace takt::drivers::cia402
