// SPDX-License-Identifier: Apache-2.0
// A policy file tried out before anything moves: which engine `policy.engine: auto` takes for it, whether it loads
// there, and the same network in ONNX Runtime, to judge it by (agreement.hpp).
//
// Files: ONNX, exploy's too; TorchScript; the YAML of a LEAPP bundle. No robot file says what their inputs are: every
// input that is no state is the observation's. A TorchScript file says no shapes: those of the ONNX file of the same
// name beside it are taken, or the width that it accepts. Thread rule: one thread, set-up or command line only.
#pragma once

#include <expected>
#include <filesystem>
#include <memory>
#include <string>

#include "policy_host/network.hpp"
#include "policy_host/onnx_runtime/onnx_runtime.hpp"
#include "policy_host/policy.hpp"

namespace takt::policy_trial {

struct TrialSetup {
  std::string library;  // ONNX Runtime's, for its engine; "": where the dynamic linker finds it
  const onnx_runtime::OnnxRuntime* judge = nullptr;  // null: nothing is judged
};

struct Trial {
  std::string engine;   // as policy.engine.name has it; "": none takes it
  std::string why;      // of ONNX Runtime: why not the built-in one
  std::string refusal;  // one line that does not name the file; "": it loads
  std::string values;   // "48→12, 2 states": of the observation, of the actions
  std::unique_ptr<policy_host::Policy>
      own;  // says every output, but of TorchScript the actions alone; null where refused
  std::unique_ptr<policy_host::Policy> judge;
  std::string unjudged;  // why there is no judge
};

Trial try_policy(const std::filesystem::path& file, const TrialSetup& setup);

// One file with every output of its network, in the file's order, by an engine.
struct WholePolicy {
  std::unique_ptr<policy_host::Policy> policy;
  std::string values;
};
enum class Outputs { all, actions };
std::expected<WholePolicy, std::string> load_whole_policy(const std::string& file, const policy_host::LoadNetwork& load,
                                                          Outputs outputs = Outputs::all);

}  // namespace takt::policy_trial
