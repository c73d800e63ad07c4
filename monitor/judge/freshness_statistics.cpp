// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/freshness_statistics.hpp"

#include <algorithm>
#include <boost/math/special_functions/beta.hpp>
#include <cmath>
#include <numeric>

namespace takt::monitor {
namespace {

// A result that cannot be computed is NaN, which no bound accepts.
namespace bmp = boost::math::policies;
constexpr bmp::policy<bmp::domain_error<bmp::ignore_error>, bmp::pole_error<bmp::ignore_error>,
                      bmp::overflow_error<bmp::ignore_error>, bmp::evaluation_error<bmp::ignore_error>,
                      bmp::promote_double<false>>
    kNoExceptions;

// Samples may be parts of one: an effective number is no whole one.
double upper_bound(double misses, double count, double confidence) {
  if (misses >= count) return 1;
  return incomplete_beta_inverse(misses + 1, count - misses, confidence);
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
  return boost::math::ibeta(a, b, std::clamp(x, 0.0, 1.0), kNoExceptions);
}

double incomplete_beta_inverse(double a, double b, double p) {
  return boost::math::ibeta_inv(a, b, p, kNoExceptions);
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
