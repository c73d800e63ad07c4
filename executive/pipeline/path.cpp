#include "executive/pipeline/path.hpp"

namespace takt::pipeline {

Range range_of(CommandField field, const JointLimits& limits) {
  switch (field) {
    case CommandField::q:
      return {limits.q_min - limits.target_margin, limits.q_max + limits.target_margin};
    case CommandField::dq:
      return {-limits.velocity, limits.velocity};
    case CommandField::kp:
      return {0.0F, kGainTolerance * limits.kp_max};
    case CommandField::kd:
      return {0.0F, kGainTolerance * limits.kd_max};
    case CommandField::tau_ff:
      return {-limits.torque, limits.torque};
  }
  return {0.0F, 0.0F};
}

Place place_of(const CommandHeader& header, Duration since, Interpolation interpolation) {
  const std::int64_t last = header.step_count - 1;
  const std::int64_t ns = std::max<std::int64_t>(since.ns, 0);
  const std::int64_t step = std::min(ns / header.step_period.ns, last);
  const std::int64_t next = interpolation == Interpolation::hold ? step : std::min(step + 1, last);
  const std::int64_t beyond = std::min(ns - step * header.step_period.ns, header.step_period.ns);
  return {static_cast<std::size_t>(step), static_cast<std::size_t>(next),
          static_cast<float>(beyond) / static_cast<float>(header.step_period.ns),
          static_cast<float>(header.step_period.ns) * 1.0e-9F};
}

PathPoint line(float q0, float q1, const Place& place) {
  if (place.step == place.next) return {q0, 0.0F, 0.0F};
  return {q0 + (q1 - q0) * place.fraction, (q1 - q0) / place.span, 0.0F};
}

PathPoint cubic(float q0, float v0, float q1, float v1, const Place& place) {
  if (place.step == place.next) return {q0, 0.0F, 0.0F};
  const float s = place.fraction;
  const float m0 = v0 * place.span;
  const float m1 = v1 * place.span;
  const float c2 = 3.0F * (q1 - q0) - 2.0F * m0 - m1;
  const float c3 = 2.0F * (q0 - q1) + m0 + m1;
  return {q0 + s * (m0 + s * (c2 + s * c3)), (m0 + s * (2.0F * c2 + s * (3.0F * c3))) / place.span,
          (2.0F * c2 + 6.0F * c3 * s) / (place.span * place.span)};
}

float PathReader::at(std::size_t step, CommandField field) {
  const float value = chunk_.values[value_index(chunk_.header, field, step, joint_)];
  const Range range = range_of(field, limits_);
  const float inside = std::clamp(value, range.low, range.high);
  out_of_range_ |= inside != value;
  return inside;
}

float PathReader::blend(CommandField field, float otherwise) {
  if (!has(field)) return otherwise;
  const float from = here(field);
  return from + (next(field) - from) * place_.fraction;
}

PathPoint PathReader::position(Interpolation interpolation) {
  const float q0 = here(CommandField::q);
  switch (interpolation) {
    case Interpolation::hold:
      return {q0, 0.0F, 0.0F};
    case Interpolation::linear:
      return line(q0, next(CommandField::q), place_);
    case Interpolation::cubic:
      return cubic(q0, here(CommandField::dq), next(CommandField::q), next(CommandField::dq), place_);
  }
  return {q0, 0.0F, 0.0F};
}

}  // namespace takt::pipeline
