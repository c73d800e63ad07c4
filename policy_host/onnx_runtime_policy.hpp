// An ONNX file behind the Policy port, run by ONNX Runtime: for what the built-in engine refuses, or runs slower
// (transformers, large convolutions). Which of its tensors is what: policy_tensors.hpp. The error is one line.
//
// Unlike the built-in engine it does not look into the network: a recurrent one that was exported without its state is
// not noticed. Equal inputs give equal bits on one machine with one version of the library, and no further.
// Thread rule: load at set-up.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "policy_host/onnx_runtime/onnx_runtime.hpp"
#include "policy_host/policy.hpp"
#include "policy_host/policy_tensors.hpp"

namespace takt::policy_host {

// `input` and `output` as assign_tensors() takes them. Infers once, so that the first answer is no slower than others.
std::expected<std::unique_ptr<Policy>, std::string> load_onnx_runtime_policy(onnx_runtime::OnnxRuntime runtime,
                                                                             const std::string& file,
                                                                             const std::string& input,
                                                                             const std::string& output);

}  // namespace takt::policy_host
