// SPDX-License-Identifier: Apache-2.0
// What trainers normalise by: per value of a feature its range, mean, standard deviation (of the population) and
// quantiles, exact and linear between neighbours.
#pragma once

#include <array>
#include <span>
#include <vector>

namespace takt::data_set {

inline constexpr std::array kQuantiles{0.01, 0.10, 0.50, 0.90, 0.99};

struct FeatureStatistics {
  std::vector<double> min, max, mean, std;                       // one per value of the feature
  std::array<std::vector<double>, kQuantiles.size()> quantiles;  // likewise, in the order of kQuantiles
  std::size_t count = 0;                                         // frames
};

// `values`: frames x width, finite, one frame at least; in the feature's own units.
FeatureStatistics statistics_of(std::span<const double> values, std::size_t width);

}  // namespace takt::data_set
