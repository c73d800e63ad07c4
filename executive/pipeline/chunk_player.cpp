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

bool has(const CommandHeader& header, CommandField field) {
  return (header.fields & static_cast<unsigned>(field)) != 0;
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

}  // namespace

std::uint8_t play(const CommandChunk& chunk, MonoTime observed_at, MonoTime now, const TickConfig& config,
                  std::span<JointTarget> targets) {
  const CommandHeader& header = chunk.header;
  const Place place = place_of(header, now - observed_at);
  const auto value = [&](CommandField field, std::size_t step, std::size_t joint) {
    return chunk.values[value_index(header, field, step, joint)];
  };
  const auto blend = [&](CommandField field, std::size_t joint) {
    const float from = value(field, place.step, joint);
    return from + (value(field, place.next, joint) - from) * place.fraction;
  };
  const bool with_dq = has(header, CommandField::dq), with_kp = has(header, CommandField::kp),
             with_kd = has(header, CommandField::kd), with_tau = has(header, CommandField::tau_ff);
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const float q0 = value(CommandField::q, place.step, j);
    const float q1 = value(CommandField::q, place.next, j);
    const PathPoint point =
        with_dq ? cubic(q0, value(CommandField::dq, place.step, j), q1, value(CommandField::dq, place.next, j), place)
                : line(q0, q1, place);
    targets[j].q = point.q;
    targets[j].dq = point.dq;
    targets[j].kp = with_kp ? blend(CommandField::kp, j) : config.joints[j].kp;
    targets[j].kd = with_kd ? blend(CommandField::kd, j) : config.joints[j].kd;
    targets[j].tau_ff = with_tau ? blend(CommandField::tau_ff, j) : 0.0F;
  }
  return static_cast<std::uint8_t>(place.step);
}

}  // namespace takt::pipeline
