// SPDX-License-Identifier: Apache-2.0
#include "lab/study/loop_margins.hpp"

#include <cmath>
#include <numbers>
#include <vector>

namespace takt::study {
namespace {

using Complex = std::complex<double>;

constexpr double kLowest_Hz = 1;
constexpr double kShareOfNyquist = 0.95;

struct Sampled {
  double log_omega = 0;
  Complex loop;
};

double log_gain(const Complex& loop) {
  return std::log(std::abs(loop));
}

// Angle above -180 degrees, in (-pi, pi].
double above_minus_180(const Complex& loop) {
  return std::arg(-loop);
}

// Where `value` of L passes through zero between two samples: regula falsi (Illinois) on the logarithm of frequency.
template <class Value>
Sampled crossing(Sampled low, Sampled high, Value value, const LoopResponse& response, int refinements) {
  double at_low = value(low.loop), at_high = value(high.loop);
  Sampled best;
  for (int round = 0;; ++round) {
    const double share = at_low / (at_low - at_high);
    best.log_omega = low.log_omega + share * (high.log_omega - low.log_omega);
    if (round == refinements) break;
    best.loop = response(std::exp(best.log_omega));
    const double here = value(best.loop);
    if (here == 0) return best;
    if ((here < 0) == (at_high < 0)) {
      high = best;
      at_high = here;
      at_low /= 2;
    } else {
      low = best;
      at_low = here;
      at_high /= 2;
    }
  }
  // The last place was not looked at: between its neighbours magnitude and phase are nearly straight lines.
  const double share = (best.log_omega - low.log_omega) / (high.log_omega - low.log_omega);
  const double gain = log_gain(low.loop) + share * (log_gain(high.loop) - log_gain(low.loop));
  const double turn = std::arg(high.loop / low.loop);
  best.loop = std::polar(std::exp(gain), std::arg(low.loop) + share * turn);
  return best;
}

void note_phase(const Sampled& at, LoopMargins& margins) {
  const double phase = above_minus_180(at.loop), omega = std::exp(at.log_omega);
  if (!margins.phase_rad || phase < *margins.phase_rad) {
    margins.phase_rad = phase;
    margins.crossover = omega;
  }
  if (!margins.delay_s || phase / omega < *margins.delay_s) margins.delay_s = phase / omega;
}

void note_gain(const Sampled& at, LoopMargins& margins) {
  const double factor = 1 / std::abs(at.loop);
  if (factor <= 1 || (margins.gain && *margins.gain <= factor)) return;
  margins.gain = factor;
  margins.gain_at = std::exp(at.log_omega);
}

}  // namespace

Sweep sweep_of(Duration step, int points, int refinements) {
  return {2 * std::numbers::pi * kLowest_Hz, kShareOfNyquist * std::numbers::pi / step.seconds(), points, refinements};
}

LoopMargins margins_of(const LoopResponse& response, const Sweep& sweep) {
  LoopMargins margins;
  const double first = std::log(sweep.from), step = (std::log(sweep.to) - first) / (sweep.points - 1);
  Sampled before{first, response(sweep.from)};
  for (int i = 1; i < sweep.points; ++i) {
    const double log_omega = first + step * i;
    const Sampled now{log_omega, response(std::exp(log_omega))};
    if ((log_gain(before.loop) > 0) != (log_gain(now.loop) > 0))
      note_phase(crossing(before, now, log_gain, response, sweep.refinements), margins);
    const double was = above_minus_180(before.loop), is = above_minus_180(now.loop);
    const bool near_axis = std::abs(was - is) < std::numbers::pi;  // not the jump at the positive real axis
    if ((was > 0) != (is > 0) && near_axis)
      note_gain(crossing(before, now, above_minus_180, response, sweep.refinements), margins);
    before = now;
  }
  return margins;
}

}  // namespace takt::study
