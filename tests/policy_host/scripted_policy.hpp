// SPDX-License-Identifier: Apache-2.0
// A policy whose arithmetic is known: output i is the call number plus i / 100, or NaN when told. Remembers its inputs.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "policy_host/policy.hpp"

namespace takt::policy_host {

class ScriptedPolicy final : public Policy {
 public:
  ScriptedPolicy(std::size_t input_size, std::size_t output_size)
      : input_size_(input_size), output_size_(output_size) {}
  [[nodiscard]] std::size_t input_size() const override { return input_size_; }
  [[nodiscard]] std::size_t output_size() const override { return output_size_; }
  void infer(std::span<const float> input, std::span<float> output) override {
    ++calls;
    last_input.assign(input.begin(), input.end());
    for (std::size_t i = 0; i < output.size(); ++i) {
      output[i] = static_cast<float>(calls) + static_cast<float>(i) / 100.0F;
    }
    if (broken) output[0] = std::numeric_limits<float>::quiet_NaN();
  }
  void reset() override { ++resets; }

  [[nodiscard]] bool is_recurrent() const override { return recurrent; }

  int calls = 0;
  int resets = 0;
  bool broken = false;
  bool recurrent = true;
  std::vector<float> last_input;

 private:
  std::size_t input_size_, output_size_;
};

}  // namespace takt::policy_host
