// Goal: differences between methods come with the right probability and an interval that covers as often as it says.
// Method: McNemar against values worked by hand from the binomial; the bootstrap against cases with a known answer, and
// its coverage over a thousand seeded synthetic panels.
#include "evidence/judge/paired_statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace takt::panel {
namespace {

TEST(McNemar, MatchesTheBinomialByHand) {
  EXPECT_DOUBLE_EQ(mcnemar_exact_p(0, 0), 1);
  EXPECT_DOUBLE_EQ(mcnemar_exact_p(4, 4), 1);
  EXPECT_DOUBLE_EQ(mcnemar_exact_p(1, 0), 1);           // 2 * 1/2
  EXPECT_NEAR(mcnemar_exact_p(0, 5), 2.0 / 32, 1e-12);  // 2 * C(5,0) / 2^5
  EXPECT_NEAR(mcnemar_exact_p(6, 0), 2.0 / 64, 1e-12);
  EXPECT_NEAR(mcnemar_exact_p(1, 7), 2.0 * (1 + 8) / 256, 1e-12);         // 0.0703125
  EXPECT_NEAR(mcnemar_exact_p(8, 2), 2.0 * (1 + 10 + 45) / 1024, 1e-12);  // 0.109375
  EXPECT_NEAR(mcnemar_exact_p(3, 4), 1, 1e-12);                           // 2 * 64 / 128
}

TEST(McNemar, DoesNotCareWhichSideIsWhich) {
  for (std::uint64_t a = 0; a < 30; ++a) {
    for (std::uint64_t b = 0; b < 30; ++b) EXPECT_DOUBLE_EQ(mcnemar_exact_p(a, b), mcnemar_exact_p(b, a));
  }
}

// By hand from the definition: half a pair in each cell, Wald's interval on n + 2.
TEST(PairedRate, IntervalIsThatOfTheAdjustedPairs) {
  const Interval none = paired_rate_interval(0, 0, 50);
  EXPECT_NEAR(none.high, 1.959964 / 52, 1e-9);
  EXPECT_DOUBLE_EQ(none.low, -none.high);
  const Interval some = paired_rate_interval(0, 6, 50);
  EXPECT_NEAR((some.low + some.high) / 2, -6.0 / 52, 1e-12);
  EXPECT_NEAR(some.high - some.low, 2 * 1.959964 * std::sqrt(7.0 - 36.0 / 52) / 52, 1e-9);
  EXPECT_EQ(paired_rate_interval(0, 1, 1).low, -1.0);
}

TEST(Bootstrap, KnownCases) {
  EXPECT_EQ(mean_difference({}, 1).pairs, 0U);
  EXPECT_FALSE(mean_difference({}, 1).interval);
  const std::vector<double> one{3};
  EXPECT_EQ(mean_difference(one, 1).mean, 3);
  EXPECT_FALSE(mean_difference(one, 1).interval);
  const std::vector<double> equal(10, 2.5);
  EXPECT_EQ(mean_difference(equal, 1).interval, (Interval{2.5, 2.5}));
  // Two differences 0 and 1: a resample's mean is 0, 1/2 or 1 with probability 1/4, 1/2, 1/4, so the interval is all.
  const std::vector<double> two{0, 1};
  EXPECT_EQ(mean_difference(two, 1).interval, (Interval{0, 1}));
  EXPECT_EQ(mean_difference(two, 1, kResamples, 0.4).interval, (Interval{0.5, 0.5}));  // its middle 40 % is 1/2
}

TEST(Bootstrap, SameSeedSameIntervalOtherSeedAnother) {
  std::vector<double> differences;
  for (int i = 0; i < 15; ++i) differences.push_back(0.37 * i * i - i);
  EXPECT_EQ(mean_difference(differences, 7).interval, mean_difference(differences, 7).interval);
  EXPECT_NE(mean_difference(differences, 7).interval, mean_difference(differences, 8).interval);
}

// 1000 synthetic panels of 20 pairs whose true mean difference is 1: the 95 % interval must cover it about as often as
// the header says (0.93). The bound leaves three standard errors; a wrong tail or a biased draw falls out of it.
TEST(Bootstrap, CoversAsOftenAsItSays) {
  std::mt19937_64 random(20261121);
  const auto uniform = [&] { return static_cast<double>(random() >> 11U) * 0x1.0p-53; };
  int covered = 0;
  constexpr int kPanels = 1000;
  for (int panel = 0; panel < kPanels; ++panel) {
    std::vector<double> differences;
    for (int pair = 0; pair < 20; ++pair) {
      double sum = 0;  // of twelve uniforms: nearly normal, variance 1
      for (int i = 0; i < 12; ++i) sum += uniform();
      differences.push_back(1 + (sum - 6));
    }
    const Interval interval = mean_difference(differences, static_cast<std::uint64_t>(panel), 1000).interval.value();
    covered += interval.low <= 1 && 1 <= interval.high ? 1 : 0;
  }
  EXPECT_GT(covered, 905);
  EXPECT_LT(covered, 960);
}

}  // namespace
}  // namespace takt::panel
