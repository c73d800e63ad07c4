#include "evidence/judge/paired_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "monitor/judge/freshness_statistics.hpp"

namespace takt::panel {
namespace {

// SplitMix64 (Steele, Lea, Flood 2014): small, and the same everywhere, which std::uniform_int_distribution is not.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : state_(seed) {}
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
  std::uint64_t state_;
};

double mean_of(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// Linear between neighbours, 0 at the smallest and 1 at the largest.
double quantile(std::span<const double> sorted, double p) {
  const double place = p * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  if (below + 1 >= sorted.size()) return sorted.back();
  return sorted[below] + (place - static_cast<double>(below)) * (sorted[below + 1] - sorted[below]);
}

}  // namespace

MeanDifference mean_difference(std::span<const double> differences, std::uint64_t seed, std::size_t resamples,
                               double confidence) {
  MeanDifference result{.pairs = differences.size(), .mean = 0, .interval = {}};
  if (differences.empty()) return result;
  result.mean = mean_of(differences);
  if (differences.size() < 2 || resamples == 0) return result;
  Draw draw(seed);
  std::vector<double> means(resamples);
  for (double& mean : means) {
    double sum = 0;
    for (std::size_t pair = 0; pair < differences.size(); ++pair) sum += differences[draw.below(differences.size())];
    mean = sum / static_cast<double>(differences.size());
  }
  std::ranges::sort(means);
  result.interval = Interval{quantile(means, (1 - confidence) / 2), quantile(means, (1 + confidence) / 2)};
  return result;
}

Interval paired_rate_interval(std::uint64_t only_a, std::uint64_t only_b, std::uint64_t pairs) {
  constexpr double kNormal = 1.959964;  // 97.5 % of it lies below
  const double a = static_cast<double>(only_a) + 0.5, b = static_cast<double>(only_b) + 0.5;
  const double n = static_cast<double>(pairs) + 2;
  const double middle = (a - b) / n;
  const double half = kNormal * std::sqrt((a + b) - (a - b) * (a - b) / n) / n;
  return {std::max(middle - half, -1.0), std::min(middle + half, 1.0)};
}

double mcnemar_exact_p(std::uint64_t only_a, std::uint64_t only_b) {
  const std::uint64_t discordant = only_a + only_b;
  const std::uint64_t fewer = std::min(only_a, only_b);
  if (fewer == only_a && fewer == only_b) return 1;  // an even split: every split is at least this uneven
  // P(X <= k) of a fair binomial is the incomplete beta function I_1/2(n - k, k + 1).
  const double tail =
      monitor::incomplete_beta(static_cast<double>(discordant - fewer), static_cast<double>(fewer + 1), 0.5);
  return std::min(1.0, 2 * tail);
}

}  // namespace takt::panel
