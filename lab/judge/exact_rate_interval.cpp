// SPDX-License-Identifier: Apache-2.0
#include "lab/judge/exact_rate_interval.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "lab/judge/seed_moments.hpp"
#include "monitor/judge/freshness_statistics.hpp"

namespace takt::lab {
namespace {

constexpr double kTail = (1 - kConfidence) / 2;

// Score statistic of a difference `d` of the rates of `up` and `down` among `pairs`.
double score(double up, double down, double pairs, double d) {
  const double excess = up - down - pairs * d;
  const double b = (2 * pairs - up + down) * d - up - down;
  const double rate_down = (std::sqrt(std::max(b * b + 8 * pairs * down * d * (1 - d), 0.0)) - b) / (4 * pairs);
  const double variance = pairs * (2 * rate_down + d * (1 - d));
  if (variance > 1e-12) return excess / std::sqrt(variance);
  return std::abs(excess) < 1e-9 ? 0 : std::copysign(1e9, excess);
}

// P(X >= successes) of a binomial X.
double upper_tail(std::uint64_t successes, std::uint64_t count, double rate) {
  if (successes == 0) return 1;
  return monitor::incomplete_beta(static_cast<double>(successes), static_cast<double>(count - successes + 1), rate);
}

// Tests differences against larger ones.
class DifferenceTest {
 public:
  // `seen_up` and `seen_down` need not be whole.
  DifferenceTest(std::uint64_t pairs, double seen_up, double seen_down)
      : pairs_(pairs), up_(seen_up), down_(seen_down), fewest_up_(pairs + 1), log_choose_(pairs + 1) {
    const auto n = static_cast<double>(pairs);
    for (std::uint64_t m = 0; m <= pairs; ++m) {
      const auto k = static_cast<double>(m);
      log_choose_[m] = std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1);
    }
  }

  bool rejects(double d) {
    find_outcomes(d);
    constexpr int kShares = 24;  // of discordant pairs; closer together where there are few
    for (int i = 0; i <= kShares; ++i) {
      const double place = static_cast<double>(i) / kShares;
      const double fewest = std::max(std::abs(d), 1e-9);
      if (probability(d, fewest + (1 - fewest) * place * place) > kTail) return false;
    }
    return true;
  }

 private:
  // For every number of discordant pairs, from how many `up` on an outcome is what was seen, or more.
  void find_outcomes(double d) {
    const auto n = static_cast<double>(pairs_);
    const double seen = score(up_, down_, n, d) - 1e-9;
    for (std::uint64_t m = 0; m <= pairs_; ++m) {
      std::uint64_t low = 0, high = m + 1;  // the score rises with `up`
      while (low < high) {
        const std::uint64_t middle = (low + high) / 2;
        const auto up = static_cast<double>(middle);
        if (score(up, static_cast<double>(m) - up, n, d) >= seen) {
          high = middle;
        } else {
          low = middle + 1;
        }
      }
      fewest_up_[m] = low;
    }
  }

  // Of those outcomes. What lies further than seven standard deviations off is left out.
  [[nodiscard]] double probability(double d, double discordant) const {
    const auto n = static_cast<double>(pairs_);
    const double rate_up = std::clamp((discordant + d) / (2 * discordant), 0.0, 1.0);
    const double reach = 7 * std::sqrt(n * discordant * (1 - discordant)) + 7;
    const auto first = static_cast<std::uint64_t>(std::max(0.0, n * discordant - reach));
    const auto last = static_cast<std::uint64_t>(std::min(n, n * discordant + reach));
    double sum = 0;
    for (std::uint64_t m = first; m <= last; ++m) {
      if (fewest_up_[m] > m) continue;
      const auto k = static_cast<double>(m);
      const double weight =
          std::exp(log_choose_[m] + k * std::log(discordant) + (m == pairs_ ? 0 : (n - k) * std::log1p(-discordant)));
      if (weight > 1e-12) sum += weight * upper_tail(fewest_up_[m], m, rate_up);
    }
    return sum;
  }

  std::uint64_t pairs_;
  double up_, down_;
  std::vector<std::uint64_t> fewest_up_;
  std::vector<double> log_choose_;
};

// Below every difference that is not rejected. The test need not be monotone: steps from -1 on, then halving.
double lower_end(std::uint64_t pairs, double up, double down) {
  DifferenceTest test(pairs, up, down);
  const double found = (up - down) / static_cast<double>(pairs);
  constexpr int kSteps = 32, kHalvings = 14;
  double low = -1, high = found;
  for (int step = 1; step < kSteps; ++step) {
    high = -1 + (found + 1) * step / kSteps;
    if (!test.rejects(high)) break;
    low = high;
    high = found;
  }
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = (low + high) / 2;
    (test.rejects(middle) ? low : high) = middle;
  }
  return low;
}

}  // namespace

double effective_pairs(std::span<const SeedSuccess> seeds) {
  SeedMoments all;
  double discordant = 0, pairs = 0;
  for (const SeedSuccess& seed : seeds) {
    all += SeedMoments(static_cast<double>(seed.only_b) - static_cast<double>(seed.only_a),
                       static_cast<double>(seed.pairs));
    discordant += static_cast<double>(seed.only_a + seed.only_b);
    pairs += static_cast<double>(seed.pairs);
  }
  const auto count = static_cast<double>(seeds.size());
  if (discordant == 0 || count < 2 || pairs == count) return count;
  const double independent = (discordant / pairs - all.mean() * all.mean()) / pairs;
  const double seen = std::max(all.variance_of_mean(), independent);
  const double few = student_quantile(pairs - 1) / student_quantile(count - 1);
  return std::max(count, pairs * (seen > 0 ? independent / seen : 1) * few * few);
}

Interval exact_rate_interval(std::span<const SeedSuccess> seeds) {
  double only_a = 0, only_b = 0, pairs = 0;
  for (const SeedSuccess& seed : seeds) {
    only_a += static_cast<double>(seed.only_a);
    only_b += static_cast<double>(seed.only_b);
    pairs += static_cast<double>(seed.pairs);
  }
  const double worth = std::floor(effective_pairs(seeds));
  const auto whole = static_cast<std::uint64_t>(worth);
  const double up = only_b * worth / pairs, down = only_a * worth / pairs;
  return {lower_end(whole, up, down), -lower_end(whole, down, up)};
}

}  // namespace takt::lab
