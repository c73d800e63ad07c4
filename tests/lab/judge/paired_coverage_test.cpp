// SPDX-License-Identifier: Apache-2.0
// Goal: an interval covers as often as its header says, tables without any difference seldom show a star, and what is
// decided at any look is seldom decided wrongly.
// Method: exact sums over all outcomes where there are few, else seeded synthetic panels whose truth is known. The
// environment variable TAKT_SYNTHETIC_PANELS asks for another number of them; the figures are printed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "lab/judge/exact_rate_interval.hpp"

namespace takt::lab {
namespace {

int panels_or(int usual) {
  const char* const wanted = std::getenv("TAKT_SYNTHETIC_PANELS");
  return wanted == nullptr ? usual : std::atoi(wanted);
}

// The same on every machine: SplitMix64 and Box & Muller.
class Random {
 public:
  double uniform() {
    state_ += 0x9E37'79B9'7F4A'7C15ULL;
    std::uint64_t mixed = state_;
    mixed = (mixed ^ (mixed >> 30U)) * 0xBF58'476D'1CE4'E5B9ULL;
    mixed = (mixed ^ (mixed >> 27U)) * 0x94D0'49BB'1331'11EBULL;
    return static_cast<double>((mixed ^ (mixed >> 31U)) >> 11U) * 0x1.0p-53;
  }
  bool chance(double probability) { return uniform() < probability; }
  double normal() { return std::sqrt(-2 * std::log1p(-uniform())) * std::cos(2 * std::numbers::pi * uniform()); }

 private:
  std::uint64_t state_ = 20261127;
};

// Share of `panels` whose interval of `seeds` seeds holds the truth, or that have none.
double mean_coverage(const char* what, std::size_t seeds, double truth,
                     const std::function<SeedDifference(Random&)>& draw) {
  Random random;
  const int panels = panels_or(1000);
  int covered = 0;
  for (int panel = 0; panel < panels; ++panel) {
    std::vector<SeedDifference> drawn;
    while (drawn.size() < seeds) drawn.push_back(draw(random));
    const auto interval = mean_difference(drawn, std::to_string(panel), 1000).interval;
    covered += !interval || (interval->low <= truth && truth <= interval->high) ? 1 : 0;
  }
  const double share = static_cast<double>(covered) / panels;
  std::printf("%s, %zu seeds: mean covered by %.2f %% of %d\n", what, seeds, 100 * share, panels);
  return share;
}

// The bounds leave three standard errors of 1000 panels to 93 %.
constexpr double kFloor = 0.93 - 0.024;

TEST(CompareCoverage, OfNumbers) {
  for (const std::size_t seeds : {10U, 20U}) {
    EXPECT_GT(mean_coverage("normal", seeds, 1, [](Random& r) { return SeedDifference{1 + r.normal(), 1}; }), kFloor);
    EXPECT_GT(mean_coverage("log-normal", seeds, std::exp(0.5),
                            [](Random& r) {
                              return SeedDifference{std::exp(r.normal()), 1};
                            }),
              kFloor);
    EXPECT_GT(mean_coverage("log-normal less log-normal", seeds, 0,
                            [](Random& r) {
                              const double a = std::exp(r.normal());
                              return SeedDifference{std::exp(r.normal()) - a, 1};
                            }),
              kFloor);
    EXPECT_GT(mean_coverage("14 conditions of a seed share an effect", seeds, 0,
                            [](Random& r) {
                              SeedDifference seed{14 * r.normal(), 14};
                              for (int pair = 0; pair < 14; ++pair) seed.sum += r.normal();
                              return seed;
                            }),
              kFloor);
  }
}

// Not so wide either that it says nothing: normal differences, against Student's interval of the same seeds.
TEST(CompareCoverage, IsNotBoughtByWidth) {
  Random random;
  double ratio = 0;
  constexpr int kPanels = 200;
  for (int panel = 0; panel < kPanels; ++panel) {
    std::vector<SeedDifference> drawn;
    double sum = 0, squares = 0;
    for (int seed = 0; seed < 20; ++seed) {
      drawn.push_back({random.normal(), 1});
      sum += drawn.back().sum;
      squares += drawn.back().sum * drawn.back().sum;
    }
    const Interval interval = mean_difference(drawn, std::to_string(panel), 1000).interval.value();
    const double student = student_quantile(19) * std::sqrt((squares - sum * sum / 20) / 19 / 20);
    ratio += (interval.high - interval.low) / (2 * student) / kPanels;
  }
  EXPECT_GT(ratio, 1);
  EXPECT_LT(ratio, 1.25);
}

double binomial_log(std::uint64_t count, std::uint64_t chosen) {
  const auto n = static_cast<double>(count), k = static_cast<double>(chosen);
  return std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1);
}

Interval interval_of(std::uint64_t only_a, std::uint64_t only_b, std::uint64_t pairs) {
  std::vector<SeedSuccess> seeds(pairs, SeedSuccess{0, 0, 1});
  for (std::uint64_t seed = 0; seed < only_a; ++seed) seeds[seed].only_a = 1;
  for (std::uint64_t seed = only_a; seed < only_a + only_b; ++seed) seeds[seed].only_b = 1;
  return exact_rate_interval(seeds);
}

TEST(ExactRate, KnowsThatNoDiscordantPairIsNoCertainty) {
  const Interval ten = interval_of(0, 0, 10);
  EXPECT_LT(ten.low, -0.30);
  EXPECT_GT(ten.low, -0.33);
  EXPECT_DOUBLE_EQ(ten.low, -ten.high);
  EXPECT_EQ(interval_of(3, 1, 12).low, -interval_of(1, 3, 12).high);
  EXPECT_GT(interval_of(0, 6, 10).low, 0);
}

// The sum over all outcomes of a panel, for many rates: no simulation, and no rate below 95 %.
TEST(ExactRate, CoversAtEveryRate) {
  for (const std::uint64_t pairs : {10U, 20U}) {
    std::map<std::pair<std::uint64_t, std::uint64_t>, Interval> intervals;
    for (std::uint64_t a = 0; a <= pairs; ++a)
      for (std::uint64_t b = 0; a + b <= pairs; ++b) intervals[{a, b}] = interval_of(a, b, pairs);
    double least = 1;
    for (int rate_a = 0; rate_a <= 40; ++rate_a) {
      for (int rate_b = 0; rate_a + rate_b <= 40; ++rate_b) {
        const double p_a = rate_a / 40.0, p_b = rate_b / 40.0, difference = p_b - p_a;
        double covered = 0;
        for (const auto& [outcome, interval] : intervals) {
          if (difference < interval.low - 1e-12 || difference > interval.high + 1e-12) continue;
          const auto [a, b] = outcome;
          covered += std::exp(binomial_log(pairs, a) + binomial_log(pairs - a, b)) *
                     std::pow(p_a, static_cast<double>(a)) * std::pow(p_b, static_cast<double>(b)) *
                     std::pow(std::max(1 - p_a - p_b, 0.0), static_cast<double>(pairs - a - b));
        }
        least = std::min(least, covered);
      }
    }
    std::printf("success, %d pairs: least coverage %.2f %%\n", static_cast<int>(pairs), 100 * least);
    EXPECT_GE(least, 0.95);
  }
}

// Seeds whose five conditions always agree are worth one pair each; independent ones nearly all of them.
TEST(ExactRate, CountsWhatSeedsAreWorth) {
  std::vector<SeedSuccess> seeds(10, SeedSuccess{0, 0, 5});
  EXPECT_EQ(effective_pairs(seeds), 10) << "without a discordant pair nothing is known of what they share";
  for (std::size_t seed = 0; seed < 3; ++seed) seeds[seed].only_b = 5;
  EXPECT_EQ(effective_pairs(seeds), 10);
  EXPECT_EQ(exact_rate_interval(seeds), interval_of(0, 3, 10));
  for (SeedSuccess& seed : seeds) seed.only_b = 2;
  EXPECT_GT(effective_pairs(seeds), 35);
  EXPECT_EQ(effective_pairs(std::vector<SeedSuccess>{{0, 5, 5}}), 1) << "one seed is one witness";
}

// Successes that differ rarely, and seeds that share a leaning.
TEST(ExactRate, CoversWhereSeedsShareAnEffect) {
  const auto coverage = [](const char* what, std::size_t seeds, double truth,
                           const std::function<SeedSuccess(Random&)>& draw) {
    Random random;
    const int panels = panels_or(60);
    int covered = 0;
    for (int panel = 0; panel < panels; ++panel) {
      std::vector<SeedSuccess> drawn;
      while (drawn.size() < seeds) drawn.push_back(draw(random));
      const Interval interval = exact_rate_interval(drawn);
      covered += interval.low <= truth && truth <= interval.high ? 1 : 0;
    }
    std::printf("success, %s, %zu seeds: covered by %.2f %% of %d\n", what, seeds, 100.0 * covered / panels, panels);
    return static_cast<double>(covered) / panels;
  };
  for (const std::size_t seeds : {10U, 20U}) {
    EXPECT_GT(coverage("6 conditions, 5 % only b", seeds, 0.05,
                       [](Random& r) {
                         SeedSuccess seed{0, 0, 6};
                         for (int pair = 0; pair < 6; ++pair) seed.only_b += r.chance(0.05) ? 1U : 0U;
                         return seed;
                       }),
              0.85);
    EXPECT_GT(coverage("6 conditions, a quarter of the seeds with 20 % only b", seeds, 0.05,
                       [](Random& r) {
                         SeedSuccess seed{0, 0, 6};
                         const double rate = r.chance(0.25) ? 0.2 : 0;
                         for (int pair = 0; pair < 6; ++pair) seed.only_b += r.chance(rate) ? 1U : 0U;
                         return seed;
                       }),
              0.85);
    EXPECT_GT(coverage("6 conditions, 30 % discordant, each seed leans to one side", seeds, 0,
                       [](Random& r) {
                         SeedSuccess seed{0, 0, 6};
                         const double to_b = r.chance(0.5) ? 0.9 : 0.1;
                         for (int pair = 0; pair < 6; ++pair) {
                           if (r.chance(0.3)) ++(r.chance(to_b) ? seed.only_b : seed.only_a);
                         }
                         return seed;
                       }),
              0.85);
  }
}

// 18 lines of one table, of ten seeds: some rare counts, some skewed numbers, all of which share an effect.
TEST(Stars, AreRareWhereNothingDiffers) {
  Random random;
  const int tables = panels_or(400);
  int starred = 0, stars = 0, excluded = 0;
  for (int table = 0; table < tables; ++table) {
    std::vector<std::vector<SeedDifference>> lines(18);
    for (int seed = 0; seed < 10; ++seed) {
      const double shared = random.normal();
      for (std::size_t line = 0; line < lines.size(); ++line) {
        const double own = line % 3 == 0 ? std::exp(random.normal()) - std::exp(random.normal()) : random.normal();
        const double rare = random.chance(0.3) ? std::copysign(1, own) : 0;
        lines[line].push_back({line % 3 == 1 ? rare : shared + own, 1});
      }
    }
    std::vector<double> p_values;
    for (const auto& line : lines) {
      p_values.push_back(sign_flip_p(line));
      excluded += p_values.back() <= kSignificance ? 1 : 0;
    }
    const auto rejected = holm_rejects(p_values);
    const auto count = std::count(rejected.begin(), rejected.end(), true);
    stars += static_cast<int>(count);
    starred += count != 0 ? 1 : 0;
  }
  std::printf("%.2f %% of %d tables without a difference have a star; %.2f lines of a table would without Holm\n",
              100.0 * starred / tables, tables, static_cast<double>(excluded) / tables);
  EXPECT_LE(starred, tables * 0.05 + 3 * std::sqrt(tables * 0.05 * 0.95));
  EXPECT_GT(excluded, stars);
}

// 10,000 panels of 500 pairs of equal methods, of which 40 % are discordant, looked at after every pair.
TEST(AnytimeEvidence, SeldomDecidesBetweenEquals) {
  Random random;
  const int panels = panels_or(10'000);
  int decided = 0;
  for (int panel = 0; panel < panels; ++panel) {
    std::uint64_t for_a = 0, for_b = 0;
    for (int pair = 0; pair < 500; ++pair) {
      if (!random.chance(0.4)) continue;
      ++(random.chance(0.5) ? for_a : for_b);
      if (anytime_evidence(for_a, for_b) < 1 / kSignificance) continue;
      ++decided;
      break;
    }
  }
  std::printf("%.2f %% of %d panels of equal methods are decided at some look\n", 100.0 * decided / panels, panels);
  EXPECT_LE(decided, panels * 0.05);
}

// Discordant pairs of which B has the share `to_b`. Exact, by the probabilities of all paths.
struct Sequential {
  double power = 0, expected = 0;
};
// Of a panel that ends after `most` discordant pairs at the latest.
Sequential sequential(double to_b, std::uint64_t most) {
  Sequential result;
  std::vector<double> open{1};  // by pairs for B
  for (std::uint64_t seen = 1; seen <= most; ++seen) {
    std::vector<double> next(seen + 1);
    for (std::size_t b = 0; b < open.size(); ++b) {
      result.expected += open[b];
      next[b] += open[b] * (1 - to_b);
      next[b + 1] += open[b] * to_b;
    }
    for (std::size_t b = 0; b < next.size(); ++b) {
      if (anytime_evidence(seen - b, b) < 1 / kSignificance) continue;
      result.power += next[b];
      next[b] = 0;
    }
    open = std::move(next);
  }
  return result;
}

// Of McNemar's exact test after all of `pairs`.
double fixed_power(double to_b, std::uint64_t pairs) {
  double power = 0, tail = 0;
  for (std::uint64_t few = 0; 2 * few < pairs; ++few) {
    tail += 2 * std::exp(binomial_log(pairs, few) - static_cast<double>(pairs) * std::numbers::ln2);
    if (tail > kSignificance) break;
    const auto k = static_cast<double>(few), n = static_cast<double>(pairs);
    const double ways = std::exp(binomial_log(pairs, few));
    power += ways * (std::pow(to_b, n - k) * std::pow(1 - to_b, k) + std::pow(to_b, k) * std::pow(1 - to_b, n - k));
  }
  return power;
}

// It saves where power is high, and does not where power is low.
TEST(AnytimeEvidence, NeedsFewerPairsThanAFixedPanelOfHighPower) {
  for (const double to_b : {0.7, 0.8, 0.9}) {
    for (const double power : {0.8, 0.9, 0.95, 0.99}) {
      std::uint64_t fixed = 5;
      while (fixed_power(to_b, fixed) < power || fixed_power(to_b, fixed + 1) < power) ++fixed;
      std::uint64_t most = 5;
      while (sequential(to_b, most).power < power) ++most;
      const double share = sequential(to_b, most).expected / static_cast<double>(fixed);
      std::printf("B has %.0f %% of discordant pairs, power %.0f %%: %.0f %% of a fixed panel's pairs\n", 100 * to_b,
                  100 * power, 100 * share);
      EXPECT_LE(share, power < 0.99 ? 1 : 0.6);
    }
  }
}

}  // namespace
}  // namespace takt::lab
