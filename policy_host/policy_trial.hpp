// A policy file tried out before anything moves: does the built-in engine take it, does it compute what ONNX Runtime
// computes, and how long does each need?
//
// Both engines get the same 16 observations, one after the other, from a fixed sequence of numbers in [-1, 1); each
// feeds its own state back. Thread rule: one thread, set-up or command line only.
#pragma once

#include <expected>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "policy_host/onnx/model.hpp"
#include "policy_host/onnx_policy.hpp"
#include "policy_host/onnx_runtime/onnx_runtime.hpp"

namespace takt::policy_host {

inline constexpr int kTrialObservations = 16;

struct Agreement {
  // Largest |a - b| / max(1, |b|) over all outputs and observations, b ONNX Runtime's.
  double error = 0;
  // One inference, the median of what the two engines took in turns, us.
  double own_us = 0;
  double peer_us = 0;
};

class PolicyTrial {
 public:
  // Which tensors are what: as assign_tensors() takes them. The error is a line that begins with the file.
  static std::expected<PolicyTrial, std::string> load(const std::filesystem::path& file, const std::string& input = "",
                                                      const std::string& output = "");

  const onnx_engine::Model& model() const { return model_; }
  const PolicyTensors& tensors() const { return tensors_; }

  // All outputs of the last of the observations, one after the other.
  std::vector<float> last_outputs();
  std::expected<Agreement, std::string> against(const onnx_runtime::OnnxRuntime& peer, int timed_inferences);

 private:
  PolicyTrial(std::filesystem::path file, onnx_engine::Model model, PolicyTensors tensors);
  void begin_observation(int i, class TrialNumbers& numbers);
  void feed_state_back();
  void forget();

  std::filesystem::path file_;
  onnx_engine::Model model_;
  PolicyTensors tensors_;
};

}  // namespace takt::policy_host
