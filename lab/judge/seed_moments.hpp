// SPDX-License-Identifier: Apache-2.0
// Sums over seeds from which a mean over their pairs and its variance follow.
#pragma once

namespace takt::lab {

class SeedMoments {
 public:
  SeedMoments() = default;
  // One seed: what its pairs add up to, and how many they are.
  SeedMoments(double sum, double pairs)
      : seeds_(1),
        sum_(sum),
        pairs_(pairs),
        sum_squared_(sum * sum),
        sum_pairs_(sum * pairs),
        pairs_squared_(pairs * pairs) {}
  void operator+=(const SeedMoments& other) {
    seeds_ += other.seeds_;
    sum_ += other.sum_;
    pairs_ += other.pairs_;
    sum_squared_ += other.sum_squared_;
    sum_pairs_ += other.sum_pairs_;
    pairs_squared_ += other.pairs_squared_;
  }
  [[nodiscard]] double mean() const { return sum_ / pairs_; }
  // Of two seeds or more. Linearised, for both sums and numbers of pairs differ from seed to seed.
  [[nodiscard]] double variance_of_mean() const {
    const double m = mean();
    const double squares = sum_squared_ - 2 * m * sum_pairs_ + m * m * pairs_squared_;
    return seeds_ / (seeds_ - 1) * (squares > 0 ? squares : 0) / (pairs_ * pairs_);
  }

 private:
  double seeds_ = 0, sum_ = 0, pairs_ = 0, sum_squared_ = 0, sum_pairs_ = 0, pairs_squared_ = 0;
};

}  // namespace takt::lab
