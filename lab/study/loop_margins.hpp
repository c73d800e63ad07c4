// SPDX-License-Identifier: Apache-2.0
// Gain, phase and delay margin of a loop from its frequency response L(i omega), measured or computed: both go through
// the same search. Pure.
//
//   gain margin    how many times larger the loop gain may become: 1/|L| where L crosses the negative real axis inside
//                  the unit circle; the smallest
//   phase margin   angle of L above -180 degrees where |L| = 1; the smallest
//   delay margin   how much later the torque may act: phase margin / omega, the smallest over all such crossings
// A margin that the range of frequencies does not show is absent. Margins speak of a loop that is stable; whether it
// is, the injected run shows by coming to rest. Source: Astrom & Murray 2021, Feedback Systems, section 10.3.
#pragma once

#include <complex>
#include <functional>
#include <optional>

#include "executive/contract/mono_time.hpp"

namespace takt::study {

using LoopResponse = std::function<std::complex<double>(double omega)>;  // rad/s

struct Sweep {
  double from = 0, to = 0;  // rad/s, 0 < from < to
  int points = 0;           // >= 2, spaced evenly in the logarithm
  int refinements = 0;      // of each crossing, by interpolation
};

struct LoopMargins {
  std::optional<double> gain;       // factor, > 1
  std::optional<double> phase_rad;  // negative: the loop is unstable
  std::optional<double> delay_s;
  std::optional<double> crossover;  // rad/s, of the smallest phase margin
  std::optional<double> gain_at;    // rad/s, of the gain margin
};

// From 1 Hz to 95 % of what a loop sampled at `step` can show.
Sweep sweep_of(Duration step, int points, int refinements);

LoopMargins margins_of(const LoopResponse& response, const Sweep& sweep);

}  // namespace takt::study
