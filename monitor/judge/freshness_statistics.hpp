// SPDX-License-Identifier: Apache-2.0
// Statistics of command ages, exact over every sample.
//
// Quantiles follow the exclusive definition: with n sorted samples the p-quantile sits at rank p (n + 1), linearly
// interpolated between neighbours and, at the ends, extrapolated from the two outermost samples, which is what
// Python's statistics.quantiles(method='exclusive') computes. With few samples p95 may thus exceed the maximum.
// Miss rates carry the one-sided upper Clopper-Pearson bound: the largest rate that would still produce at most this
// many misses with probability 1 - confidence. Samples that depend on their neighbours say less than their number:
// bounds are those of the effective number of samples. Consecutive ticks share a command and are counted as if they did
// not, so a per-tick bound is optimistic and a per-command one is the one to quote. A contract is held, or violated,
// where the bound on that side says so at the contract's confidence; else the samples do not decide.
// Sources: Hyndman & Fan 1996, definition 6; Clopper & Pearson 1934; Bayley & Hammersley 1946 (effective number);
// Marriott & Pope 1954 (bias of a short series' correlation).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "executive/contract/mono_time.hpp"

namespace takt::monitor {

inline constexpr std::uint64_t kFewestForP999 = 999;

struct Quantiles {
  std::uint64_t count = 0;
  double p50 = 0, p95 = 0, p99 = 0;  // unit of the samples; all zero without samples
  std::optional<double> p999{};      // empty below kFewestForP999 samples: it would lie beyond the largest
  double max = 0;
};

// Exclusive quantile, 0 < p < 1, of sorted samples; one sample is its own quantile. Precondition: not empty.
double exclusive_quantile(std::span<const std::int64_t> sorted, double p);
// Sorts `samples` in place.
Quantiles quantiles_of(std::vector<std::int64_t>& samples);

// Upper end of the one-sided Clopper-Pearson interval; 1 when misses == count, also without samples.
double clopper_pearson_upper(std::uint64_t misses, std::uint64_t count, double confidence);
// The lower end; 0 without misses, also without samples.
double clopper_pearson_lower(std::uint64_t misses, std::uint64_t count, double confidence);
// Regularised incomplete beta function I_x(a, b), a, b > 0, 0 <= x <= 1.
double incomplete_beta(double a, double b, double x);
// The x with I_x(a, b) = p, 0 <= p <= 1.
double incomplete_beta_inverse(double a, double b, double p);

enum class Verdict : std::uint8_t {
  held,       // the upper bound is within epsilon
  undecided,  // epsilon lies between the bounds: too few samples to claim either
  violated,   // the lower bound exceeds epsilon
};

struct MissRate {
  std::uint64_t misses = 0;
  std::uint64_t count = 0;
  double rate = 0;
  double effective_count = 0;  // independent samples that say as much, at most count
  double lower_bound = 0, upper_bound = 1;
  Verdict verdict = Verdict::undecided;
};
// `effective_count` in 1..count, or 0 without samples.
MissRate miss_rate(std::uint64_t misses, std::uint64_t count, double effective_count, double epsilon,
                   double confidence);
// Of independent samples.
MissRate miss_rate(std::uint64_t misses, std::uint64_t count, double epsilon, double confidence);

// How many independent samples say as much as `ages`, in the order they came: n (1 - r) / (1 + r), where r is the
// larger of two lag-one correlations, of the ages' ranks and of being older than `max_age`, freed of a short series'
// bias. All of them where r is not distinguishable from 0 at 95 %. Bounds of it cover 95 % for ages of any lag-one
// correlation up to 0.99; stalls that the samples do not show are in no bound.
double effective_count(std::span<const std::int64_t> ages, std::int64_t max_age);

// The deployment rule of the worked example: a stack whose p95 age is past its limit belongs in degraded mode.
constexpr bool should_degrade(const Quantiles& ages, double max_age) {
  return ages.count != 0 && ages.p95 > max_age;
}

}  // namespace takt::monitor
