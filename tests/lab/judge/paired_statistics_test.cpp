// SPDX-License-Identifier: Apache-2.0
// Goal: differences between methods come with the right probability, and with an interval only where pairs bound them.
// Method: values worked by hand from the binomial distribution; cases with a known answer. How often intervals cover
// is for paired_coverage_test.cpp.
#include "lab/judge/paired_statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace takt::lab {
namespace {

using Seeds = std::vector<SeedDifference>;

// One pair per seed.
Seeds pairs_of(const std::vector<double>& differences) {
  Seeds seeds;
  for (const double difference : differences) seeds.push_back({difference, 1});
  return seeds;
}

double mcnemar_p(std::uint64_t only_a, std::uint64_t only_b) {
  Seeds seeds(only_a, {-1, 1});
  seeds.insert(seeds.end(), only_b, {1, 1});
  seeds.insert(seeds.end(), 3, {0, 1});
  return sign_flip_p(seeds);
}

TEST(SignFlip, IsMcNemarsTestWithOnePairPerSeed) {
  EXPECT_DOUBLE_EQ(mcnemar_p(0, 0), 1);
  EXPECT_DOUBLE_EQ(mcnemar_p(4, 4), 1);
  EXPECT_DOUBLE_EQ(mcnemar_p(1, 0), 1);           // 2 * 1/2
  EXPECT_NEAR(mcnemar_p(0, 5), 2.0 / 32, 1e-12);  // 2 * C(5,0) / 2^5
  EXPECT_NEAR(mcnemar_p(6, 0), 2.0 / 64, 1e-12);
  EXPECT_NEAR(mcnemar_p(1, 7), 2.0 * (1 + 8) / 256, 1e-12);         // 0.0703125
  EXPECT_NEAR(mcnemar_p(8, 2), 2.0 * (1 + 10 + 45) / 1024, 1e-12);  // 0.109375
  EXPECT_NEAR(mcnemar_p(3, 4), 1, 1e-12);                           // 2 * 64 / 128
}

TEST(SignFlip, DoesNotCareWhichSideIsWhich) {
  for (std::uint64_t a = 0; a < 30; ++a) {
    for (std::uint64_t b = 0; b < 30; ++b) EXPECT_DOUBLE_EQ(mcnemar_p(a, b), mcnemar_p(b, a));
  }
}

// By hand over all signs. Ten pairs of one seed are one witness, not ten.
TEST(SignFlip, TakesASeedsPairsTogether) {
  EXPECT_NEAR(sign_flip_p(Seeds{{2, 2}, {1, 2}}), 0.5, 1e-12);  // 3 and -3 of 3, 1, -1, -3
  EXPECT_NEAR(sign_flip_p(Seeds{{3, 5}, {-1, 5}}), 1, 1e-12);   // 2 is the least far of all
  EXPECT_NEAR(sign_flip_p(Seeds{{10, 10}}), 1, 1e-12);
  EXPECT_NEAR(sign_flip_p(pairs_of({0.5, 0.26, 0.13})), 0.25, 1e-12);
  EXPECT_NEAR(sign_flip_p(pairs_of(std::vector<double>(10, 1e-5))), 2.0 / 1024, 1e-12);
}

TEST(Holm, RejectsByHand) {
  EXPECT_EQ(holm_rejects(std::vector{0.01, 0.04, 0.03, 0.005}), (std::vector{true, false, false, true}));
  EXPECT_EQ(holm_rejects(std::vector{0.03, 0.02}), (std::vector{true, true}));
  EXPECT_EQ(holm_rejects(std::vector{0.03, 0.026}), (std::vector{false, false}));
  EXPECT_TRUE(holm_rejects({}).empty());
}

// B(1/2, n + 1/2) / B(1/2, 1/2) is C(2n, n) / 4^n.
TEST(AnytimeEvidence, MatchesTheBetaMixtureByHand) {
  EXPECT_NEAR(anytime_evidence(0, 0), 1, 1e-12);
  EXPECT_NEAR(anytime_evidence(0, 6), 924.0 / 64, 1e-9);
  EXPECT_NEAR(anytime_evidence(7, 0), 3432.0 / 128, 1e-9);
  EXPECT_LT(anytime_evidence(50, 50), 0.2);
}

TEST(Student, MatchesTheTable) {
  EXPECT_NEAR(student_quantile(1), 12.7062, 1e-4);
  EXPECT_NEAR(student_quantile(9), 2.26216, 1e-5);
  EXPECT_NEAR(student_quantile(1e5), 1.95999, 1e-5);
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

TEST(MeanDifference, HasNoIntervalWhereSeedsDoNotBoundIt) {
  EXPECT_EQ(mean_difference({}, "line").pairs, 0U);
  EXPECT_FALSE(mean_difference({}, "line").interval);
  const MeanDifference one = mean_difference(Seeds{{30, 10}}, "line");
  EXPECT_EQ(one.mean, 3);
  EXPECT_EQ(one.pairs, 10U);
  EXPECT_FALSE(one.interval) << "ten pairs of one seed";
  EXPECT_FALSE(mean_difference(pairs_of(std::vector<double>(10, 2.5)), "line").interval) << "no spread";
  EXPECT_FALSE(mean_difference(pairs_of({0, 0, 0, 0, 0, 0, 0, 1, 2, 3}), "line").interval) << "three differ";
  const MeanDifference four = mean_difference(pairs_of({0, 0, 0, 0, 0, 0, 1, 2, 3, 4}), "line");
  ASSERT_TRUE(four.interval);
  EXPECT_LT(four.interval->low, 0);
  EXPECT_GT(four.interval->high, 2);
}

TEST(MeanDifference, PairsOfOneSeedAreOneWitness) {
  Seeds single, repeated;
  for (int i = 0; i < 12; ++i) {
    const double difference = 0.37 * i * i - i;
    single.push_back({difference, 1});
    repeated.push_back({14 * difference, 14});
  }
  const MeanDifference few = mean_difference(single, "line"), many = mean_difference(repeated, "line");
  EXPECT_NEAR(few.interval->low, many.interval->low, 1e-9);
  EXPECT_NEAR(few.interval->high, many.interval->high, 1e-9);
  EXPECT_EQ(many.pairs, 168U);
}

TEST(MeanDifference, EveryLineDrawsFromAGeneratorOfItsOwn) {
  const Seeds seeds = pairs_of({0.1, 0.5, 0.7, -0.4, 2, 3, 9, -1, 0.2, 5});
  EXPECT_EQ(mean_difference(seeds, "all rearms").interval, mean_difference(seeds, "all rearms").interval);
  EXPECT_NE(mean_difference(seeds, "all rearms").interval, mean_difference(seeds, "all success").interval);
}

}  // namespace
}  // namespace takt::lab
