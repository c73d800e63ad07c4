// SPDX-License-Identifier: Apache-2.0
// A learned policy as the host sees it: numbers in, numbers out. The port behind which inference engines stand.
//
// Sizes are fixed after load and at least 1. infer() reads the whole input and writes the whole output; a recurrent
// policy also advances its hidden state. Values are whatever the network makes of them: NaN comes out as NaN, the
// executive is the judge. Thread rule: one thread at a time; infer() runs as long as the network needs.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace takt::policy_host {

class Policy {
 public:
  Policy() = default;
  Policy(const Policy&) = delete;
  Policy& operator=(const Policy&) = delete;
  virtual ~Policy() = default;

  [[nodiscard]] virtual std::size_t input_size() const = 0;
  [[nodiscard]] virtual std::size_t output_size() const = 0;
  // Precondition: input.size() == input_size(), output.size() == output_size().
  virtual void infer(std::span<const float> input, std::span<float> output) = 0;
  // Forgets the past: hidden state as it was after load.
  virtual void reset() = 0;
  // False: what infer() says follows from its input alone, so that several of these may answer in turn.
  [[nodiscard]] virtual bool is_recurrent() const { return true; }
  // What runs it, for the log: "ONNX Runtime 1.30.0, cpu, 1 thread".
  [[nodiscard]] virtual std::string description() const { return "an engine"; }
  // True of the built-in engine alone: `takt policy replay` runs it again and expects the same bits.
  [[nodiscard]] virtual bool is_built_in() const { return false; }
};

}  // namespace takt::policy_host
