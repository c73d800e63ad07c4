// SPDX-License-Identifier: Apache-2.0
// A compiled model: steps bound to storage at load, run in order ever after.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "policy_host/onnx_engine/constant_pool.hpp"
#include "policy_host/onnx_engine/model.hpp"
#include "policy_host/onnx_engine/tensor.hpp"

namespace takt::onnx_engine {

// One piece of arithmetic with its pointers already resolved.
class Step {
 public:
  Step() = default;
  Step(const Step&) = delete;
  Step& operator=(const Step&) = delete;
  virtual ~Step() = default;
  virtual void run() noexcept = 0;
};

struct Program {
  std::vector<FloatBuffer> buffers;
  std::vector<SharedFloats> constants;
  std::vector<std::unique_ptr<Step>> steps;
  std::vector<TensorInfo> input_info;
  std::vector<TensorInfo> output_info;
  std::vector<std::span<float>> inputs;
  std::vector<std::span<const float>> outputs;
  std::int64_t opset = 0;
  OperatorCounts operators;
  std::vector<ExternalFile> external_files;
  Metadata metadata;
  std::vector<std::string> lost_states;
  std::uint64_t matrix_work = 0;
};

}  // namespace takt::onnx_engine
