// SPDX-License-Identifier: Apache-2.0
#include "lab/judge/paired_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "lab/judge/seed_moments.hpp"
#include "monitor/judge/freshness_statistics.hpp"

namespace takt::lab {
namespace {

constexpr double kResampledTail = 0.015;

// SplitMix64 (Steele, Lea, Flood 2014): small, and the same everywhere, which std::uniform_int_distribution is not.
class Draw {
 public:
  // Started by FNV-1a of the name.
  explicit Draw(std::string_view name) {
    for (const char c : name) state_ = (state_ ^ static_cast<unsigned char>(c)) * 0x100'0000'01B3ULL;
  }
  std::size_t below(std::size_t limit) {
    state_ += 0x9E37'79B9'7F4A'7C15ULL;
    std::uint64_t mixed = state_;
    mixed = (mixed ^ (mixed >> 30U)) * 0xBF58'476D'1CE4'E5B9ULL;
    mixed = (mixed ^ (mixed >> 27U)) * 0x94D0'49BB'1331'11EBULL;
    mixed ^= mixed >> 31U;
    // High 32 bits scaled to 0..limit-1; the bias is below limit / 2^32.
    return static_cast<std::size_t>((mixed >> 32U) * limit >> 32U);
  }

 private:
  std::uint64_t state_ = 0xCBF2'9CE4'8422'2325ULL;
};

// Sorted ratios of a resample's mean to its standard error; infinite where it has no spread.
std::vector<double> resampled_ratios(std::span<const SeedMoments> seeds, double variance, Draw draw,
                                     std::size_t resamples) {
  std::vector<double> ratios(resamples);
  for (double& ratio : ratios) {
    SeedMoments drawn;
    for (std::size_t seed = 0; seed < seeds.size(); ++seed) drawn += seeds[draw.below(seeds.size())];
    const double spread = drawn.variance_of_mean();
    ratio = spread > 1e-12 * variance ? drawn.mean() / std::sqrt(spread)
                                      : std::copysign(std::numeric_limits<double>::infinity(), drawn.mean());
  }
  std::ranges::sort(ratios);
  return ratios;
}

// A seed's sum in cells: whole numbers as they are, others in 8192ths of their total.
struct Cells {
  std::vector<std::int64_t> sums;
  std::int64_t slack = 0;  // by how much rounding can have moved the sum of them, and that of other signs
};

Cells cells_of(std::span<const SeedDifference> seeds, double total) {
  constexpr double kMost = 8192;
  const bool whole =
      total <= kMost && std::ranges::all_of(seeds, [](const auto& seed) { return seed.sum == std::round(seed.sum); });
  Cells cells;
  for (const SeedDifference& seed : seeds)
    cells.sums.push_back(std::llround(whole ? seed.sum : seed.sum * kMost / total));
  if (!whole) cells.slack = static_cast<std::int64_t>(seeds.size());
  return cells;
}

}  // namespace

MeanDifference mean_difference(std::span<const SeedDifference> seeds, std::string_view line, std::size_t resamples) {
  MeanDifference result{.pairs = 0, .seeds = seeds.size(), .mean = 0, .interval = {}};
  double sum = 0, largest = 0;
  for (const SeedDifference& seed : seeds) {
    result.pairs += seed.pairs;
    sum += seed.sum;
    largest = std::max(largest, std::abs(seed.sum));
  }
  if (result.pairs == 0) return result;
  result.mean = sum / static_cast<double>(result.pairs);
  if (seeds.size() < 2) return result;
  std::vector<SeedMoments> each;  // of differences from that mean
  SeedMoments all;
  for (const SeedDifference& seed : seeds) {
    const auto pairs = static_cast<double>(seed.pairs);
    each.emplace_back(seed.sum - result.mean * pairs, pairs);
    all += each.back();
  }
  const double variance = all.variance_of_mean();
  const double error = std::sqrt(variance);
  if (error * static_cast<double>(result.pairs) <= 1e-12 * largest) return result;  // no spread at all
  const std::vector<double> ratios = resampled_ratios(each, variance, Draw(line), resamples);
  const auto outside = static_cast<std::size_t>(kResampledTail * static_cast<double>(resamples));
  const double student = student_quantile(static_cast<double>(seeds.size() - 1));
  const double below = std::max(ratios[resamples - 1 - outside], student);
  const double above = std::max(-ratios[outside], student);
  if (std::isfinite(below) && std::isfinite(above))
    result.interval = Interval{result.mean - below * error, result.mean + above * error};
  return result;
}

double sign_flip_p(std::span<const SeedDifference> seeds) {
  double total = 0;
  for (const SeedDifference& seed : seeds) total += std::abs(seed.sum);
  if (total == 0) return 1;
  const auto [sums, slack] = cells_of(seeds, total);
  std::size_t most = 0;
  for (const std::int64_t sum : sums) most += static_cast<std::size_t>(std::abs(sum));
  // Probability of every sum of those that have a plus.
  std::vector<double> probability(most + 1);
  probability[0] = 1;
  std::size_t reached = 0;
  for (const std::int64_t sum : sums) {
    const auto size = static_cast<std::size_t>(std::abs(sum));
    if (size == 0) continue;
    reached += size;
    for (std::size_t plus = reached + 1; plus-- > 0;)
      probability[plus] = 0.5 * (probability[plus] + (plus >= size ? probability[plus - size] : 0));
  }
  const std::int64_t far = std::abs(std::accumulate(sums.begin(), sums.end(), std::int64_t{0})) - slack;
  double p = 0;
  for (std::size_t plus = 0; plus <= most; ++plus)
    if (std::abs(2 * static_cast<std::int64_t>(plus) - static_cast<std::int64_t>(most)) >= far) p += probability[plus];
  return std::min(p, 1.0);
}

std::vector<bool> holm_rejects(std::span<const double> p_values) {
  std::vector<std::size_t> order(p_values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t at) { return p_values[at]; });
  std::vector<bool> rejected(p_values.size());
  for (std::size_t step = 0; step < order.size(); ++step) {
    if (p_values[order[step]] > kSignificance / static_cast<double>(order.size() - step)) break;
    rejected[order[step]] = true;
  }
  return rejected;
}

double anytime_evidence(std::uint64_t for_a, std::uint64_t for_b) {
  const auto a = static_cast<double>(for_a), b = static_cast<double>(for_b);
  return std::exp(std::lgamma(a + 0.5) + std::lgamma(b + 0.5) - std::lgamma(a + b + 1) - std::log(std::numbers::pi) +
                  (a + b) * std::numbers::ln2);
}

double student_quantile(double degrees) {
  // P(|T| > t) is the incomplete beta function of degrees / (degrees + t^2).
  const double share = monitor::incomplete_beta_inverse(degrees / 2, 0.5, 1 - kConfidence);
  return std::sqrt(degrees * (1 - share) / share);
}

Interval paired_rate_interval(std::uint64_t only_a, std::uint64_t only_b, std::uint64_t pairs) {
  constexpr double kNormal = 1.959964;  // 97.5 % of it lies below
  const double a = static_cast<double>(only_a) + 0.5, b = static_cast<double>(only_b) + 0.5;
  const double n = static_cast<double>(pairs) + 2;
  const double middle = (a - b) / n;
  const double half = kNormal * std::sqrt((a + b) - (a - b) * (a - b) / n) / n;
  return {std::max(middle - half, -1.0), std::min(middle + half, 1.0)};
}

}  // namespace takt::lab
