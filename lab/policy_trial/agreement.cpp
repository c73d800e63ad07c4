// SPDX-License-Identifier: Apache-2.0
#include "lab/policy_trial/agreement.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

namespace takt::policy_trial {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kTimeToSpend{4};
constexpr std::size_t kFewestInferences = 20;

// A linear congruential generator's upper bits (Numerical Recipes' constants).
class TrialNumbers {
 public:
  void fill(std::span<float> values) {
    for (float& value : values) {
      state_ = state_ * 1664525U + 1013904223U;
      value = static_cast<float>(state_ >> 8U) * 0x1p-23F - 1.0F;
    }
  }

 private:
  std::uint32_t state_ = 1;
};

void note_differences(std::span<const float> own, std::span<const float> judge, Agreement& agreement) {
  for (std::size_t i = 0; i < own.size(); ++i) {
    agreement.error = std::max(agreement.error, distance_of(own[i], judge[i]));
    agreement.both_nan += std::isnan(own[i]) && std::isnan(judge[i]) ? 1U : 0U;
  }
}

template <class Work>
double microseconds(Work work) {
  const auto begin = Clock::now();
  work();
  return std::chrono::duration<double, std::micro>(Clock::now() - begin).count();
}

double median(std::vector<double> samples) {
  const auto middle = samples.begin() + std::ssize(samples) / 2;
  std::ranges::nth_element(samples, middle);
  return *middle;
}

void take_times(policy_host::Policy& own, policy_host::Policy& judge, std::span<const float> observation,
                std::size_t most, Agreement& agreement) {
  std::vector<float> said(own.output_size());
  std::vector<double> own_us, judge_us;
  const auto end = Clock::now() + kTimeToSpend;
  while (own_us.size() < most && (own_us.size() < kFewestInferences || Clock::now() < end)) {
    own_us.push_back(microseconds([&] { own.infer(observation, said); }));
    judge_us.push_back(microseconds([&] { judge.infer(observation, said); }));
  }
  agreement.own_us = median(std::move(own_us));
  agreement.judge_us = median(std::move(judge_us));
}

}  // namespace

double distance_of(float own, float judge) {
  if (own == judge || (std::isnan(own) && std::isnan(judge))) return 0;
  const double b = static_cast<double>(judge);
  const double apart = std::abs(static_cast<double>(own) - b) / std::max(1.0, std::abs(b));
  return std::isnan(apart) ? std::numeric_limits<double>::infinity() : apart;
}

std::vector<float> last_outputs(policy_host::Policy& policy) {
  TrialNumbers numbers;
  std::vector<float> observation(policy.input_size()), outputs(policy.output_size());
  policy.reset();
  for (int i = 0; i < kTrialObservations; ++i) {
    numbers.fill(observation);
    policy.infer(observation, outputs);
  }
  return outputs;
}

Agreement compare(policy_host::Policy& own, policy_host::Policy& judge, std::size_t most_inferences) {
  Agreement agreement;
  TrialNumbers numbers;
  std::vector<float> observation(own.input_size()), own_outputs(own.output_size()), judge_outputs(judge.output_size());
  own.reset();
  judge.reset();
  for (int i = 0; i < kTrialObservations; ++i) {
    numbers.fill(observation);
    own.infer(observation, own_outputs);
    judge.infer(observation, judge_outputs);
    note_differences(own_outputs, judge_outputs, agreement);
  }
  if (most_inferences > 0) take_times(own, judge, observation, most_inferences, agreement);
  return agreement;
}

}  // namespace takt::policy_trial
