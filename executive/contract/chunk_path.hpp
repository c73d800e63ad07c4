// SPDX-License-Identifier: Apache-2.0
// Where the steps of a chunk lead between two of them: straight lines, or cubic Hermite segments through positions and
// velocities. Step k belongs to the chunk's first instant + k * step_period. Pure.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt {

struct PathPoint {
  float q = 0;    // rad
  float dq = 0;   // rad/s
  float ddq = 0;  // rad/s^2
};

constexpr PathPoint operator+(const PathPoint& a, const PathPoint& b) {
  return {a.q + b.q, a.dq + b.dq, a.ddq + b.ddq};
}
constexpr PathPoint operator-(const PathPoint& a, const PathPoint& b) {
  return {a.q - b.q, a.dq - b.dq, a.ddq - b.ddq};
}

// Between which two steps, and how far.
struct Place {
  std::size_t step = 0;
  std::size_t next = 0;  // == step during the last step's period, and where steps are held
  float fraction = 0;    // 0..1
  float span = 0;        // s, one step period
};

// `since`: the first step's instant; before it the first step counts, after the end the last. step_count >= 1.
constexpr Place place_of(const CommandHeader& header, Duration since, bool steps_are_held) {
  const std::int64_t last = header.step_count - 1;
  const std::int64_t ns = std::max<std::int64_t>(since.ns, 0);
  const std::int64_t step = std::min(ns / header.step_period.ns, last);
  const std::int64_t next = steps_are_held ? step : std::min(step + 1, last);
  const std::int64_t beyond = std::min(ns - step * header.step_period.ns, header.step_period.ns);
  return {static_cast<std::size_t>(step), static_cast<std::size_t>(next),
          static_cast<float>(beyond) / static_cast<float>(header.step_period.ns),
          static_cast<float>(header.step_period.ns) * 1.0e-9F};
}

constexpr PathPoint line(float q0, float q1, const Place& place) {
  if (place.step == place.next) return {q0, 0.0F, 0.0F};
  return {q0 + (q1 - q0) * place.fraction, (q1 - q0) / place.span, 0.0F};
}

// From q0 (velocity v0) to q1 (v1).
constexpr PathPoint cubic(float q0, float v0, float q1, float v1, const Place& place) {
  if (place.step == place.next) return {q0, 0.0F, 0.0F};
  const float s = place.fraction;
  const float m0 = v0 * place.span;
  const float m1 = v1 * place.span;
  const float c2 = 3.0F * (q1 - q0) - 2.0F * m0 - m1;
  const float c3 = 2.0F * (q0 - q1) + m0 + m1;
  return {q0 + s * (m0 + s * (c2 + s * c3)), (m0 + s * (2.0F * c2 + s * (3.0F * c3))) / place.span,
          (2.0F * c2 + 6.0F * c3 * s) / (place.span * place.span)};
}

}  // namespace takt
