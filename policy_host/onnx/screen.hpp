// First look at an untrusted model, before libonnx reasons about it: only what this engine could evaluate passes.
#pragma once

#include <cstdint>
#include <string>

#include "policy_host/onnx/builder.hpp"

namespace onnx {
class ModelProto;
class TensorProto;
}  // namespace onnx

namespace takt::onnx_engine {

// Throws Refusal unless the model has one known opset, only supported operators with plain attributes, and only tensors
// of a supported type whose data is inside the file and exactly as long as the shape says.
void screen_model(const onnx::ModelProto& model);

std::int64_t opset_of(const onnx::ModelProto& model);

// A screened tensor as a constant.
Value& define_constant(Builder& builder, const std::string& name, const onnx::TensorProto& tensor);

}  // namespace takt::onnx_engine
