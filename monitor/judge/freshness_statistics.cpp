// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/freshness_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace takt::monitor {
namespace {

// Continued fraction of the incomplete beta function by the modified Lentz method; converges fast for
// x < (a + 1) / (a + b + 2). Source: Press et al., Numerical Recipes, 6.4.
double beta_fraction(double a, double b, double x) {
  constexpr double tiny = 1e-300;
  const auto guarded = [](double value) { return std::abs(value) < tiny ? tiny : value; };
  double c = 1;
  double d = 1 / guarded(1 - (a + b) * x / (a + 1));
  double fraction = d;
  for (int step = 1; step <= 100'000; ++step) {
    const double m = step;
    const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    d = 1 / guarded(1 + even * d);
    c = guarded(1 + even / c);
    fraction *= d * c;
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    d = 1 / guarded(1 + odd * d);
    c = guarded(1 + odd / c);
    const double change = d * c;
    fraction *= change;
    if (std::abs(change - 1) < 4 * std::numeric_limits<double>::epsilon()) break;
  }
  return fraction;
}

// Samples may be parts of one: an effective number is no whole one.
double upper_bound(double misses, double count, double confidence) {
  if (misses >= count) return 1;
  const double a = misses + 1;
  const double b = count - misses;
  double low = 0, high = 1;
  while (high - low > 1e-15 * high) {  // I_x(a, b) grows with x; halving ends within some 100 steps
    const double middle = low + (high - low) / 2;
    if (middle <= low || middle >= high) break;
    (incomplete_beta(a, b, middle) < confidence ? low : high) = middle;
  }
  return high;
}

double lower_bound(double misses, double count, double confidence) {
  return misses <= 0 ? 0 : 1 - upper_bound(count - misses, count, confidence);
}

// Equal values share the mean of their ranks.
std::vector<double> ranks_of(std::span<const std::int64_t> values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t at) { return values[at]; });
  std::vector<double> ranks(values.size());
  for (std::size_t first = 0, last = 0; first < order.size(); first = last) {
    while (last < order.size() && values[order[last]] == values[order[first]]) ++last;
    for (std::size_t at = first; at < last; ++at) ranks[order[at]] = 0.5 * static_cast<double>(first + last - 1);
  }
  return ranks;
}

double lag_one_correlation(std::span<const double> values) {
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  double product = 0, square = 0;
  for (std::size_t at = 0; at < values.size(); ++at) {
    square += (values[at] - mean) * (values[at] - mean);
    if (at != 0) product += (values[at] - mean) * (values[at - 1] - mean);
  }
  return square > 0 ? product / square : 0;
}

}  // namespace

double exclusive_quantile(std::span<const std::int64_t> sorted, double p) {
  const std::size_t n = sorted.size();
  if (n == 1) return static_cast<double>(sorted[0]);
  const double rank = p * (static_cast<double>(n) + 1);
  const auto below = std::clamp<std::size_t>(static_cast<std::size_t>(rank), 1, n - 1);
  const double share = rank - static_cast<double>(below);
  const auto low = static_cast<double>(sorted[below - 1]);
  const auto high = static_cast<double>(sorted[below]);
  return low + share * (high - low);
}

Quantiles quantiles_of(std::vector<std::int64_t>& samples) {
  if (samples.empty()) return {};
  std::sort(samples.begin(), samples.end());
  Quantiles quantiles{.count = samples.size(),
                      .p50 = exclusive_quantile(samples, 0.5),
                      .p95 = exclusive_quantile(samples, 0.95),
                      .p99 = exclusive_quantile(samples, 0.99),
                      .max = static_cast<double>(samples.back())};
  if (samples.size() >= kFewestForP999) quantiles.p999 = exclusive_quantile(samples, 0.999);
  return quantiles;
}

double incomplete_beta(double a, double b, double x) {
  if (x <= 0) return 0;
  if (x >= 1) return 1;
  const double front =
      std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log1p(-x));
  if (x < (a + 1) / (a + b + 2)) return front * beta_fraction(a, b, x) / a;
  return 1 - front * beta_fraction(b, a, 1 - x) / b;
}

double clopper_pearson_upper(std::uint64_t misses, std::uint64_t count, double confidence) {
  return upper_bound(static_cast<double>(misses), static_cast<double>(count), confidence);
}

double clopper_pearson_lower(std::uint64_t misses, std::uint64_t count, double confidence) {
  return lower_bound(static_cast<double>(misses), static_cast<double>(count), confidence);
}

MissRate miss_rate(std::uint64_t misses, std::uint64_t count, double effective_count, double epsilon,
                   double confidence) {
  MissRate result{.misses = misses, .count = count, .effective_count = effective_count};
  if (count != 0) result.rate = static_cast<double>(misses) / static_cast<double>(count);
  const double worth = count == 0 ? 1 : effective_count / static_cast<double>(count);
  const double missed = static_cast<double>(misses) * worth;
  result.lower_bound = lower_bound(missed, effective_count, confidence);
  result.upper_bound = misses >= count ? 1 : upper_bound(missed, effective_count, confidence);
  if (result.lower_bound > epsilon) result.verdict = Verdict::violated;
  if (result.upper_bound <= epsilon) result.verdict = Verdict::held;
  return result;
}

MissRate miss_rate(std::uint64_t misses, std::uint64_t count, double epsilon, double confidence) {
  return miss_rate(misses, count, static_cast<double>(count), epsilon, confidence);
}

double effective_count(std::span<const std::int64_t> ages, std::int64_t max_age) {
  const auto n = static_cast<double>(ages.size());
  if (ages.size() < 3) return n;
  std::vector<double> missed(ages.size());
  std::ranges::transform(ages, missed.begin(), [&](std::int64_t age) { return age > max_age ? 1.0 : 0.0; });
  double correlation = 0;
  for (const double seen : {lag_one_correlation(ranks_of(ages)), lag_one_correlation(missed)}) {
    const double unbiased = std::min(seen + (1 + 3 * seen) / n, 0.999);
    if (unbiased * std::sqrt(n) > 1.645) correlation = std::max(correlation, unbiased);
  }
  return std::max(n * (1 - correlation) / (1 + correlation), 1.0);
}

}  // namespace takt::monitor
