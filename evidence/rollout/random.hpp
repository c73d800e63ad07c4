// SPDX-License-Identifier: Apache-2.0
// Random numbers that are the same on every standard library, unlike its distributions. One stream per place that
// decides, so that a perturbation which draws more leaves every other stream alone. Thread rule: one thread at a time.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "simulation/chance.hpp"

namespace takt::evidence {

class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t stream) : bits_(simulation::seed_for(seed, stream)) {}

  double unit() { return static_cast<double>(bits_() >> 11U) * 0x1p-53; }  // [0, 1)
  double between(double low, double high) { return low + (high - low) * unit(); }
  bool happens(double share) { return simulation::happens(share, bits_); }
  std::uint64_t below(std::uint64_t count) { return bits_() % count; }

  // Box-Muller; one of the pair is thrown away.
  double normal() {
    const double radius = std::sqrt(-2 * std::log(1 - unit()));
    return radius * std::cos(2 * std::numbers::pi * unit());
  }
  // With this mean (not median); `spread` is the standard deviation of the logarithm.
  double lognormal(double mean, double spread) { return mean * std::exp(spread * normal() - spread * spread / 2); }

 private:
  std::mt19937_64 bits_;
};

}  // namespace takt::evidence
