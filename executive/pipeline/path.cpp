// SPDX-License-Identifier: Apache-2.0
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
  return takt::place_of(header, since, interpolation == Interpolation::hold);
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
