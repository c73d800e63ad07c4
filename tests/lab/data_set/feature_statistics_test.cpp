// SPDX-License-Identifier: Apache-2.0
// Goal: the statistics that trainers normalise by are those of the numbers. Method: numbers whose statistics are known
// by hand; the standard deviation is the population's, quantiles lie on the line between neighbours.
#include "lab/data_set/feature_statistics.hpp"

#include <gtest/gtest.h>

namespace takt::data_set {
namespace {

TEST(FeatureStatistics, EachValueHasItsOwn) {
  // Frames of two values: 4 2 0 1 3 and five times -7.
  const std::vector<double> values{4, -7, 2, -7, 0, -7, 1, -7, 3, -7};
  const FeatureStatistics found = statistics_of(values, 2);
  EXPECT_EQ(found.count, 5U);
  EXPECT_EQ(found.min, (std::vector<double>{0, -7}));
  EXPECT_EQ(found.max, (std::vector<double>{4, -7}));
  EXPECT_EQ(found.mean, (std::vector<double>{2, -7}));
  EXPECT_DOUBLE_EQ(found.std[0], 1.4142135623730951);
  EXPECT_EQ(found.std[1], 0);
  const double by_hand[] = {0.04, 0.4, 2.0, 3.6, 3.96};  // q01 q10 q50 q90 q99 of 0 1 2 3 4
  for (std::size_t each = 0; each < kQuantiles.size(); ++each) {
    EXPECT_NEAR(found.quantiles[each][0], by_hand[each], 1e-12) << kQuantiles[each];
    EXPECT_EQ(found.quantiles[each][1], -7);
  }
}

TEST(FeatureStatistics, OneFrameIsItsOwnQuantiles) {
  const FeatureStatistics found = statistics_of(std::vector<double>{0.25}, 1);
  EXPECT_EQ(found.count, 1U);
  EXPECT_EQ(found.std[0], 0);
  for (const auto& quantile : found.quantiles) EXPECT_EQ(quantile[0], 0.25);
}

}  // namespace
}  // namespace takt::data_set
