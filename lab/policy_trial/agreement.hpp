// SPDX-License-Identifier: Apache-2.0
// Two policies on the same observations: do they say the same, and how long does each take?
//
// Observations are 16 in sequence, of a fixed sequence of numbers in [-1, 1), the same on every machine; hidden state
// goes round in each. Thread rule: one thread, set-up or command line only.
#pragma once

#include <cstddef>
#include <vector>

#include "policy_host/policy.hpp"

namespace takt::policy_trial {

inline constexpr int kTrialObservations = 16;

struct Agreement {
  // Largest |a - b| / max(1, |b|) over all outputs and observations, b the judge's; infinite: one of them said NaN, or
  // infinity, where the other did not. Never NaN.
  double error = 0;
  std::size_t both_nan = 0;  // outputs for which both said NaN: no difference, and no agreement on a value either
  // One inference, the median of what the two took in turns, us.
  double own_us = 0;
  double judge_us = 0;
};

// Difference of one output, as in Agreement::error. NaN against a number is infinitely far; both NaN: 0.
double distance_of(float own, float judge);

// All outputs after the last of the observations.
std::vector<float> last_outputs(policy_host::Policy& policy);

// `most_inferences`: timed of each, or as many as take a few seconds; 0: none. Precondition: both have the same sizes.
// Throws std::runtime_error where an engine fails.
Agreement compare(policy_host::Policy& own, policy_host::Policy& judge, std::size_t most_inferences);

}  // namespace takt::policy_trial
