// SPDX-License-Identifier: Apache-2.0
// Goal: the review's numbers are the ones a statistician would compute. Method: the worked example of the mission,
// values computed with Python's statistics and SciPy-independent closed forms, and properties of the bound.
#include "monitor/judge/freshness_statistics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

namespace takt::monitor {
namespace {

// The worked example: ten ages in ms against a limit of 40 ms.
TEST(FreshnessStatistics, WorkedExampleDegradesOnItsTail) {
  std::vector<std::int64_t> ages{28, 32, 35, 31, 40, 29, 36, 34, 52, 33};
  const auto over = static_cast<std::uint64_t>(std::count_if(ages.begin(), ages.end(), [](auto a) { return a > 40; }));
  const MissRate misses = miss_rate(over, ages.size(), 0.01, 0.95);
  const Quantiles quantiles = quantiles_of(ages);
  EXPECT_DOUBLE_EQ(std::round(quantiles.p95 * 10) / 10, 57.4);
  EXPECT_NEAR(quantiles.p95, 57.4, 1e-12);
  EXPECT_DOUBLE_EQ(misses.rate, 0.1);
  EXPECT_TRUE(should_degrade(quantiles, 40));
  EXPECT_EQ(misses.verdict, Verdict::undecided) << "one late command of ten is no proof of more than 1 %";
  EXPECT_DOUBLE_EQ(quantiles.max, 52);
}

// At a true rate of just epsilon either claim is false, and may be made in one run of twenty.
TEST(FreshnessStatistics, AClaimAtTheEdgeIsWrongInOneRunOfTwentyAtMost) {
  constexpr double kEpsilon = 0.01;
  constexpr int kRuns = 2000;
  std::mt19937_64 random(33);
  for (const std::uint64_t commands : {50U, 120U, 300U, 1000U}) {
    std::binomial_distribution<std::uint64_t> misses(commands, kEpsilon);
    int held = 0, violated = 0;
    for (int run = 0; run < kRuns; ++run) {
      const Verdict verdict = miss_rate(misses(random), commands, kEpsilon, 0.95).verdict;
      held += verdict == Verdict::held ? 1 : 0;
      violated += verdict == Verdict::violated ? 1 : 0;
    }
    std::printf("%llu commands: held %.1f %%, violated %.1f %%\n", static_cast<unsigned long long>(commands),
                100.0 * held / kRuns, 100.0 * violated / kRuns);
    EXPECT_LE(held, kRuns * 6 / 100) << commands;
    EXPECT_LE(violated, kRuns * 6 / 100) << commands;
  }
}

// Ages that depend on the one before: the bounds that were computed of their number covered 60 % at 0.95. Method:
// ages whose normal scores are a series of that lag-one correlation, at a true rate of 5 %; how often each bound keeps
// on its side of the truth, against the 95 % that it claims.
TEST(FreshnessStatistics, BoundsCoverAgesThatDependOnEachOther) {
  constexpr int kRuns = 1000;
  constexpr double kOnePercentile95 = 1.6448536269514722, kRate = 0.05;
  const auto max_age = static_cast<std::int64_t>(kOnePercentile95 * 1e9);
  std::mt19937_64 random(33);
  std::normal_distribution<double> normal;
  for (const std::size_t commands : {120U, 300U, 1000U}) {
    for (const double correlation : {0.0, 0.5, 0.8, 0.95}) {
      int above = 0, below = 0;
      for (int run = 0; run < kRuns; ++run) {
        std::vector<std::int64_t> ages;
        for (double score = normal(random); ages.size() < commands;
             score = correlation * score + std::sqrt(1 - correlation * correlation) * normal(random))
          ages.push_back(std::llround(score * 1e9));
        const auto missed =
            static_cast<std::uint64_t>(std::ranges::count_if(ages, [&](auto a) { return a > max_age; }));
        const MissRate misses = miss_rate(missed, commands, effective_count(ages, max_age), 0.01, 0.95);
        above += misses.upper_bound >= kRate ? 1 : 0;
        below += misses.lower_bound <= kRate ? 1 : 0;
      }
      std::printf("%zu commands, correlation %.2f: upper bound covers %.1f %%, lower %.1f %%\n", commands, correlation,
                  100.0 * above / kRuns, 100.0 * below / kRuns);
      EXPECT_GE(above, kRuns * 93 / 100) << commands << " at " << correlation;
      EXPECT_GE(below, kRuns * 93 / 100) << commands << " at " << correlation;
    }
  }
}

// Misses that come in one stall are one event, also where the other ages say nothing of it.
TEST(FreshnessStatistics, AStallIsOneEvent) {
  std::mt19937_64 random(34);
  std::vector<std::int64_t> ages;
  for (int i = 0; i < 400; ++i) ages.push_back(static_cast<std::int64_t>(random() % 40));
  EXPECT_EQ(effective_count(ages, 40), 400) << "ages at random are as many as they are";
  std::fill_n(ages.begin() + 200, 20, 90);
  const double apart = effective_count(ages, 40);
  EXPECT_LT(apart, 60);
  EXPECT_EQ(miss_rate(20, 400, 0.03, 0.95).verdict, Verdict::violated);
  EXPECT_EQ(miss_rate(20, 400, apart, 0.03, 0.95).verdict, Verdict::undecided);
  EXPECT_EQ(effective_count(std::vector<std::int64_t>(300, 5), 40), 300)
      << "always the same age: nothing to tell apart";
  EXPECT_EQ(effective_count({}, 40), 0);
}

// Python: statistics.quantiles(range(1, 101), n=100, method='exclusive')[k - 1] == 1.01 k.
TEST(FreshnessStatistics, ExclusiveQuantilesOfOneToHundred) {
  std::vector<std::int64_t> samples;
  for (std::int64_t value = 100; value >= 1; --value) samples.push_back(value);
  const Quantiles quantiles = quantiles_of(samples);
  EXPECT_NEAR(quantiles.p50, 50.5, 1e-9);
  EXPECT_NEAR(quantiles.p95, 95.95, 1e-9);
  EXPECT_NEAR(quantiles.p99, 99.99, 1e-9);
  EXPECT_EQ(quantiles.count, 100U);
}

TEST(FreshnessStatistics, OneSampleIsEveryQuantileAndNoneIsZero) {
  std::vector<std::int64_t> one{7};
  EXPECT_EQ(quantiles_of(one).p99, 7);
  EXPECT_FALSE(quantiles_of(one).p999.has_value()) << "nothing says so much";
  std::vector<std::int64_t> many(998, 3);
  EXPECT_FALSE(quantiles_of(many).p999.has_value());
  many.push_back(9);
  EXPECT_EQ(quantiles_of(many).p999, 9) << "never beyond the largest";
  std::vector<std::int64_t> none;
  EXPECT_EQ(quantiles_of(none).count, 0U);
  EXPECT_FALSE(should_degrade(quantiles_of(none), 40));
}

// Closed forms: no miss in n gives 1 - (1 - confidence)^(1/n); all but one give confidence^(1/n).
TEST(FreshnessStatistics, BoundMatchesClosedForms) {
  for (const std::uint64_t n : {1U, 10U, 300U, 20'000U, 3'600'000U}) {
    const double exponent = 1.0 / static_cast<double>(n);
    EXPECT_NEAR(clopper_pearson_upper(0, n, 0.95) / -std::expm1(std::log(0.05) * exponent), 1, 1e-6) << n;
    EXPECT_NEAR(clopper_pearson_upper(n - 1, n, 0.95), std::pow(0.95, exponent), 1e-6) << n;
  }
  EXPECT_EQ(clopper_pearson_upper(5, 5, 0.95), 1);
  EXPECT_EQ(clopper_pearson_upper(0, 0, 0.95), 1);
}

// The definition itself: at the bound, at most k misses happen with probability 1 - confidence (binomial sum).
TEST(FreshnessStatistics, BoundMeetsItsDefinition) {
  for (const std::uint64_t misses : {1U, 3U, 8U}) {
    const double p = clopper_pearson_upper(misses, 20, 0.95);
    double tail = 0, term = std::pow(1 - p, 20);
    for (std::uint64_t k = 0; k <= misses; ++k) {
      tail += term;
      term *= static_cast<double>(20 - k) / static_cast<double>(k + 1) * p / (1 - p);
    }
    EXPECT_NEAR(tail, 0.05, 1e-9) << misses;
  }
}

TEST(FreshnessStatistics, VerdictNeedsEvidenceToHold) {
  EXPECT_EQ(miss_rate(0, 10, 0.01, 0.95).verdict, Verdict::undecided);
  EXPECT_EQ(miss_rate(0, 1'000, 0.01, 0.95).verdict, Verdict::held);
  EXPECT_EQ(miss_rate(20, 1'000, 0.01, 0.95).verdict, Verdict::violated);
  EXPECT_EQ(miss_rate(0, 0, 0.01, 0.95).verdict, Verdict::undecided);
}

// Millions of ticks stay exact: a known permutation of 0..3599999.
TEST(FreshnessStatistics, AnHourOfTicksIsExact) {
  constexpr std::int64_t count = 3'600'000;
  std::vector<std::int64_t> samples(count);
  for (std::int64_t index = 0; index < count; ++index) {
    samples[static_cast<std::size_t>(index)] = (index * 1'000'003) % count;
  }
  const Quantiles quantiles = quantiles_of(samples);
  EXPECT_NEAR(quantiles.p50, (count - 1) / 2.0, 1e-6);
  EXPECT_NEAR(quantiles.p99, 0.99 * (count + 1) - 1, 1e-6);
}

}  // namespace
}  // namespace takt::monitor
