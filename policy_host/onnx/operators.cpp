#include "policy_host/onnx/operators.hpp"

#include <algorithm>
#include <array>

namespace takt::onnx_engine {

namespace {

struct Entry {
  std::string_view op_type;
  BuildOperator build;
};

// Sorted, for the reader and for the refusal that lists them.
constexpr auto table = std::to_array<Entry>({
    {"Add", build_add},
    {"Cast", build_cast},
    {"Clip", build_clip},
    {"Concat", build_concat},
    {"Constant", build_constant},
    {"ConstantOfShape", build_constant_of_shape},
    {"Div", build_div},
    {"Elu", build_elu},
    {"Erf", build_erf},
    {"Expand", build_expand},
    {"Flatten", build_flatten},
    {"GRU", build_gru},
    {"Gather", build_gather},
    {"Gemm", build_gemm},
    {"Identity", build_identity},
    {"LSTM", build_lstm},
    {"LayerNormalization", build_layer_normalization},
    {"LeakyRelu", build_leaky_relu},
    {"MatMul", build_matmul},
    {"Mul", build_mul},
    {"Pow", build_pow},
    {"ReduceMean", build_reduce_mean},
    {"Relu", build_relu},
    {"Reshape", build_reshape},
    {"Shape", build_shape},
    {"Sigmoid", build_sigmoid},
    {"Slice", build_slice},
    {"Softmax", build_softmax},
    {"Sqrt", build_sqrt},
    {"Squeeze", build_squeeze},
    {"Sub", build_sub},
    {"Tanh", build_tanh},
    {"Transpose", build_transpose},
    {"Unsqueeze", build_unsqueeze},
});

}  // namespace

BuildOperator find_operator(std::string_view op_type) {
  const auto* found = std::ranges::find(table, op_type, &Entry::op_type);
  return found == table.end() ? nullptr : found->build;
}

std::string supported_operators() {
  std::string names;
  for (const Entry& entry : table) {
    if (!names.empty()) names += ", ";
    names += entry.op_type;
  }
  return names;
}

}  // namespace takt::onnx_engine
