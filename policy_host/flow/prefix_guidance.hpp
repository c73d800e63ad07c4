// SPDX-License-Identifier: Apache-2.0
// Weights by which a flow policy is drawn towards the path it continues while it denoises (real-time chunking; rule:
// Physical-Intelligence/real-time-chunking-kinetix, arXiv 2506.07339). Pure.
//
// Of a chunk's steps, the first `delay` are played before the answer arrives (Observation::committed_count, when the
// executive promises them); those from `end` on are free, where `end` is the chunk's steps less those played between
// two answers. Per denoising step, with v the network's velocity at x and time t (0 noise, 1 action):
//
//   v' = v + guidance_scale(t, limit) * weight * (path - (x + (1 - t) v))
//
// per value, where the network's Jacobian is taken as the identity; `path` is the one in use, continued with its last
// step where it ends, never with zeros.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "config/robot_config.hpp"

namespace takt::policy_host {

using config::PrefixSchedule;

// 0..1. Where delay > end, end counts for both.
inline double prefix_weight(PrefixSchedule schedule, std::size_t step, std::size_t delay, std::size_t end) {
  if (step >= end) return 0.0;
  const auto start = static_cast<double>(std::min(delay, end));
  const auto at = static_cast<double>(step);
  const double line = std::clamp((start - 1.0 - at) / (static_cast<double>(end) - start + 1.0) + 1.0, 0.0, 1.0);
  switch (schedule) {
    case PrefixSchedule::ones:  // all alike up to the end
      return 1.0;
    case PrefixSchedule::zeros:  // the promised steps only
      return at < start ? 1.0 : 0.0;
    case PrefixSchedule::linear:  // falling from there to the end in a straight line
      return line;
    case PrefixSchedule::exponential:  // the same line, bent: w (e^w - 1) / (e - 1)
      return line * std::expm1(line) / std::expm1(1.0);
  }
  return 0.0;
}

// Of the error's share in the velocity, at most `limit` > 0 (published: 5). t in 0..1; at t = 0 it is the limit.
inline double guidance_scale(double t, double limit) {
  const double rest = 1.0 - t;
  const double scale = rest / t * (t * t + rest * rest) / (rest * rest);
  return std::isfinite(scale) ? std::min(limit, scale) : limit;
}

}  // namespace takt::policy_host
