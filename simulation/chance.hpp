// SPDX-License-Identifier: Apache-2.0
// Random decisions that are the same on every standard library, unlike its distributions.
#pragma once

#include <cstdint>
#include <random>

namespace takt::simulation {

// True with probability `share` (0..1). Draws only where there is something to decide, so that a fault that is off
// leaves the sequence alone.
inline bool happens(double share, std::mt19937_64& random) {
  if (share <= 0) return false;
  return static_cast<double>(random() >> 11U) * 0x1p-53 < share;  // 53 random bits in [0, 1)
}

// A generator of its own for each place that decides, all from the simulation's seed.
inline std::uint64_t seed_for(std::uint64_t seed, std::uint64_t place) {
  return seed ^ (0x9E37'79B9'7F4A'7C15U * (place + 1));
}

}  // namespace takt::simulation
