// SPDX-License-Identifier: Apache-2.0
#include "lab/data_set/feature_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace takt::data_set {
namespace {

double quantile(std::span<const double> sorted, double share) {
  const double place = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return std::lerp(sorted[below], sorted[above], place - static_cast<double>(below));
}

}  // namespace

FeatureStatistics statistics_of(std::span<const double> values, std::size_t width) {
  FeatureStatistics found;
  found.count = values.size() / width;
  const auto count = static_cast<double>(found.count);
  std::vector<double> column(found.count);
  for (std::size_t place = 0; place < width; ++place) {
    for (std::size_t frame = 0; frame < found.count; ++frame) column[frame] = values[frame * width + place];
    std::ranges::sort(column);
    const double mean = std::accumulate(column.begin(), column.end(), 0.0) / count;
    const double squares = std::accumulate(column.begin(), column.end(), 0.0, [mean](double sum, double value) {
      return sum + (value - mean) * (value - mean);
    });
    found.min.push_back(column.front());
    found.max.push_back(column.back());
    found.mean.push_back(mean);
    found.std.push_back(std::sqrt(squares / count));
    for (std::size_t each = 0; each < kQuantiles.size(); ++each)
      found.quantiles[each].push_back(quantile(column, kQuantiles[each]));
  }
  return found;
}

}  // namespace takt::data_set
