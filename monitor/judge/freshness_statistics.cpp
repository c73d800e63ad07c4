#include "monitor/judge/freshness_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

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
  return {samples.size(),
          exclusive_quantile(samples, 0.5),
          exclusive_quantile(samples, 0.95),
          exclusive_quantile(samples, 0.99),
          exclusive_quantile(samples, 0.999),
          static_cast<double>(samples.back())};
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
  if (misses >= count) return 1;
  const double a = static_cast<double>(misses) + 1;
  const double b = static_cast<double>(count - misses);
  double low = 0, high = 1;
  while (high - low > 1e-15 * high) {  // I_x(a, b) grows with x; halving ends within some 100 steps
    const double middle = low + (high - low) / 2;
    if (middle <= low || middle >= high) break;
    (incomplete_beta(a, b, middle) < confidence ? low : high) = middle;
  }
  return high;
}

double clopper_pearson_lower(std::uint64_t misses, std::uint64_t count, double confidence) {
  return misses == 0 ? 0 : 1 - clopper_pearson_upper(count - misses, count, confidence);
}

MissRate miss_rate(std::uint64_t misses, std::uint64_t count, double epsilon, double confidence) {
  MissRate result{misses, count, 0, clopper_pearson_upper(misses, count, confidence), Verdict::undecided};
  if (count != 0) result.rate = static_cast<double>(misses) / static_cast<double>(count);
  if (clopper_pearson_lower(misses, count, confidence) > epsilon) result.verdict = Verdict::violated;
  if (result.upper_bound <= epsilon) result.verdict = Verdict::held;
  return result;
}

}  // namespace takt::monitor
