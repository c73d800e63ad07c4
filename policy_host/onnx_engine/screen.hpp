// SPDX-License-Identifier: Apache-2.0
// First look at an untrusted model, before libonnx reasons about it: only what this engine could evaluate passes.
#pragma once

#include <cstdint>
#include <string>

#include "policy_host/onnx_engine/builder.hpp"

namespace onnx {
class ModelProto;
class TensorProto;
}  // namespace onnx

namespace takt::onnx_engine {

// The oldest opset whose operators are evaluated; older ones are lifted to it (lift.hpp).
inline constexpr std::int64_t kOldestOpset = 8;

// Throws Refusal (Beyond where another engine may know more) unless the model has one opset that this engine takes,
// only supported operators with attributes, inputs and outputs that they have (from
// kOldestOpset on), and only tensors of a supported type
// whose data is exactly as long as the shape says. It needs no libonnx that knows the opset. Data of other files must
// have been brought in (external_data.hpp).
void screen_model(const onnx::ModelProto& model);

std::int64_t opset_of(const onnx::ModelProto& model);
// Whether the installed libonnx can check it and infer its shapes.
bool libonnx_knows(std::int64_t opset);

// A screened tensor as a constant.
Value& define_constant(Builder& builder, const std::string& name, const onnx::TensorProto& tensor);

}  // namespace takt::onnx_engine
