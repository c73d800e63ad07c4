// SPDX-License-Identifier: Apache-2.0
// Velocity networks whose flow is known: input one observed value, then x, then times.
#pragma once

#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "policy_host/policy.hpp"

namespace takt::policy_host {

// Every noise ends at `chunk(x at t = 0)`, whatever is done to x on the way: v = (chunk - x) / (1 - t). Remembers what
// it was shown.
class Denoiser final : public Policy {
 public:
  using Chunk = std::function<float(std::span<const float> noise, std::size_t value)>;
  Denoiser(std::size_t values, std::size_t times, Chunk chunk)
      : values_(values), times_(times), chunk_(std::move(chunk)) {}

  [[nodiscard]] std::size_t input_size() const override { return 1 + values_ + times_; }
  [[nodiscard]] std::size_t output_size() const override { return values_; }
  [[nodiscard]] bool is_recurrent() const override { return recurrent; }
  void reset() override {}
  void infer(std::span<const float> input, std::span<float> output) override {
    shown.emplace_back(input.begin(), input.end());
    const std::span<const float> x = input.subspan(1, values_), times = input.last(times_);
    if (times.back() == 0.0F) noise_.assign(x.begin(), x.end());
    for (std::size_t value = 0; value < values_; ++value) {
      const float left = 1.0F - times[times_ == 1 ? 0 : value * times_ / values_];
      output[value] = left > 0.0F ? (chunk_(noise_, value) - x[value]) / left : 0.0F;
    }
  }

  std::vector<std::vector<float>> shown;
  bool recurrent = false;

 private:
  std::size_t values_, times_;
  Chunk chunk_;
  std::vector<float> noise_;
};

}  // namespace takt::policy_host
