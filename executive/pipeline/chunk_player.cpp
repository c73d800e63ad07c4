#include "executive/pipeline/chunk_player.hpp"

#include <algorithm>

namespace takt::pipeline {
namespace {

// Between which two steps, and how far.
struct Place {
  std::size_t step;
  std::size_t next;  // == step during the last step's period
  float fraction;    // 0..1
  float span;        // s, one step period
};

Place place_of(const CommandHeader& header, Duration since) {
  const std::int64_t last = header.step_count - 1;
  const std::int64_t ns = std::max<std::int64_t>(since.ns, 0);
  const std::int64_t step = std::min(ns / header.step_period.ns, last);
  const std::int64_t next = std::min(step + 1, last);
  const std::int64_t beyond = std::min(ns - step * header.step_period.ns, header.step_period.ns);
  return {static_cast<std::size_t>(step), static_cast<std::size_t>(next),
          static_cast<float>(beyond) / static_cast<float>(header.step_period.ns),
          static_cast<float>(header.step_period.ns) * 1.0e-9F};
}

struct PathPoint {
  float q, dq;
};

PathPoint line(float q0, float q1, const Place& place) {
  if (place.step == place.next) return {q0, 0.0F};
  return {q0 + (q1 - q0) * place.fraction, (q1 - q0) / place.span};
}

// Cubic Hermite segment through (q0, v0) and (q1, v1).
PathPoint cubic(float q0, float v0, float q1, float v1, const Place& place) {
  if (place.step == place.next) return {q0, 0.0F};
  const float s = place.fraction;
  const float m0 = v0 * place.span;
  const float m1 = v1 * place.span;
  const float c2 = 3.0F * (q1 - q0) - 2.0F * m0 - m1;
  const float c3 = 2.0F * (q0 - q1) + m0 + m1;
  return {q0 + s * (m0 + s * (c2 + s * c3)), (m0 + s * (2.0F * c2 + s * (3.0F * c3))) / place.span};
}

struct Range {
  float low, high;
};

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

// One joint's values at the two steps around the instant.
class Reader {
 public:
  Reader(const CommandChunk& chunk, const Place& place, std::size_t joint, const JointLimits& limits)
      : chunk_(chunk), place_(place), joint_(joint), limits_(limits) {}

  [[nodiscard]] bool has(CommandField field) const {
    return (chunk_.header.fields & static_cast<unsigned>(field)) != 0;
  }
  [[nodiscard]] bool out_of_range() const { return out_of_range_; }
  float here(CommandField field) { return at(place_.step, field); }
  float next(CommandField field) { return at(place_.next, field); }
  float blend(CommandField field, float otherwise) {
    if (!has(field)) return otherwise;
    const float from = here(field);
    return from + (next(field) - from) * place_.fraction;
  }

 private:
  float at(std::size_t step, CommandField field) {
    const float value = chunk_.values[value_index(chunk_.header, field, step, joint_)];
    const Range range = range_of(field, limits_);
    const float inside = std::clamp(value, range.low, range.high);
    out_of_range_ |= inside != value;
    return inside;
  }

  const CommandChunk& chunk_;
  const Place& place_;
  std::size_t joint_;
  const JointLimits& limits_;
  bool out_of_range_ = false;
};

PathPoint path_at(Reader& reader, const Place& place, Interpolation interpolation) {
  const float q0 = reader.here(CommandField::q);
  const float q1 = reader.next(CommandField::q);
  switch (interpolation) {
    case Interpolation::hold:
      return {q0, 0.0F};
    case Interpolation::linear:
      return line(q0, q1, place);
    case Interpolation::cubic:
      return cubic(q0, reader.here(CommandField::dq), q1, reader.next(CommandField::dq), place);
  }
  return {q0, 0.0F};
}

}  // namespace

std::uint8_t play(const CommandChunk& chunk, MonoTime observed_at, MonoTime now, const TickConfig& config,
                  std::span<JointTarget> targets) {
  Place place = place_of(chunk.header, now - observed_at);
  if (config.interpolation == Interpolation::hold) place.next = place.step;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const JointConfig& joint = config.joints[j];
    Reader reader(chunk, place, j, joint.limits);
    const PathPoint point = path_at(reader, place, config.interpolation);
    const bool holds_dq = config.interpolation == Interpolation::hold && reader.has(CommandField::dq);
    JointTarget& target = targets[j];
    target.q = point.q;
    target.dq = point.dq;
    target.kp = reader.blend(CommandField::kp, joint.kp);
    target.kd = reader.blend(CommandField::kd, joint.kd);
    target.tau_ff = reader.blend(CommandField::tau_ff, 0.0F);
    target.dq_held = holds_dq ? std::clamp(reader.here(CommandField::dq), -target.speed, target.speed) : 0.0F;
    target.out_of_range = reader.out_of_range();
  }
  return static_cast<std::uint8_t>(place.step);
}

}  // namespace takt::pipeline
