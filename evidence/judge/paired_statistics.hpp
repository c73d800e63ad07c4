// Statistics of paired outcomes: the same task, seed and perturbation under two methods.
//
// Everything is reproducible: resampling draws from a generator of its own, seeded by the caller, whose sequence is
// the same on every machine.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace takt::panel {

struct Interval {
  double low = 0, high = 0;
  friend bool operator==(const Interval&, const Interval&) = default;
};

struct MeanDifference {
  std::size_t pairs = 0;
  double mean = 0;                   // of b - a; 0 without pairs
  std::optional<Interval> interval;  // empty with fewer than two pairs: one difference says nothing about its spread
};

inline constexpr std::size_t kResamples = 10'000;
inline constexpr double kConfidence = 0.95;

// Percentile bootstrap of the mean over whole pairs. Its coverage falls short of `confidence` with few pairs: about
// 0.90 instead of 0.95 at ten, 0.93 at twenty. Source: Efron & Tibshirani 1993, An Introduction to the Bootstrap,
// chapter 13.
MeanDifference mean_difference(std::span<const double> differences, std::uint64_t seed,
                               std::size_t resamples = kResamples, double confidence = kConfidence);

// Two-sided exact McNemar test from the discordant pairs: how likely a split at least this uneven is when either method
// is as likely to be the one that succeeds. 1 without discordant pairs. Source: McNemar 1947, exact binomial form.
double mcnemar_exact_p(std::uint64_t only_a, std::uint64_t only_b);

// 95 % interval of how much more often a succeeds than b, -1..1, from the discordant pairs of `pairs` > 0: Wald's, with
// half a pair added to each of the four cells, so that no discordant pair is no certainty. Source: Agresti & Min 2005,
// Simple improved confidence intervals for comparing matched proportions.
Interval paired_rate_interval(std::uint64_t only_a, std::uint64_t only_b, std::uint64_t pairs);

}  // namespace takt::panel
