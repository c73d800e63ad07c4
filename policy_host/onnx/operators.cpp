// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx/operators.hpp"

#include <algorithm>
#include <array>

namespace takt::onnx_engine {

namespace {

struct Entry {
  std::string_view op_type;
  BuildOperator build;
  OperatorForm form;
};

constexpr std::size_t any_number = 1'000'000;

// Sorted, for the reader and for the refusal that lists them.
constexpr auto table = std::to_array<Entry>({
    {"Abs", build_abs, {}},
    {"Add", build_add, {.most_inputs = 2}},
    {"AveragePool",
     build_average_pool,
     {.attributes = "auto_pad ceil_mode count_include_pad dilations kernel_shape pads strides"}},
    {"BatchNormalization",
     build_batch_normalization,
     {.most_inputs = 5, .attributes = "epsilon momentum training_mode"}},
    {"Cast", build_cast, {.attributes = "to saturate"}},
    {"Clip", build_clip, {.most_inputs = 3, .attributes = "min max"}},
    {"Concat", build_concat, {.most_inputs = any_number, .attributes = "axis"}},
    {"Constant",
     build_constant,
     {.most_inputs = 0,
      .attributes = "value value_float value_floats value_int value_ints value_string value_strings"}},
    {"ConstantOfShape", build_constant_of_shape, {.attributes = "value"}},
    {"Conv", build_conv, {.most_inputs = 3, .attributes = "auto_pad dilations group kernel_shape pads strides"}},
    {"Cos", build_cos, {}},
    {"Div", build_div, {.most_inputs = 2}},
    {"Elu", build_elu, {.attributes = "alpha"}},
    {"Equal", build_equal, {.most_inputs = 2}},
    {"Erf", build_erf, {}},
    {"Exp", build_exp, {}},
    {"Expand", build_expand, {.most_inputs = 2}},
    {"Flatten", build_flatten, {.attributes = "axis"}},
    {"GRU",
     build_gru,
     {.most_inputs = 6,
      .most_outputs = 2,
      .attributes =
          "activation_alpha activation_beta activations clip direction hidden_size layout linear_before_reset"}},
    {"Gather", build_gather, {.most_inputs = 2, .attributes = "axis"}},
    {"Gelu", build_gelu, {.attributes = "approximate"}},
    {"Gemm", build_gemm, {.most_inputs = 3, .attributes = "alpha beta transA transB"}},
    {"GlobalAveragePool", build_global_average_pool, {}},
    {"Greater", build_greater, {.most_inputs = 2}},
    {"GreaterOrEqual", build_greater_or_equal, {.most_inputs = 2}},
    {"Identity", build_identity, {}},
    {"If", build_if, {.most_outputs = any_number, .attributes = "else_branch then_branch"}},
    {"LSTM",
     build_lstm,
     {.most_inputs = 8,
      .most_outputs = 3,
      .attributes = "activation_alpha activation_beta activations clip direction hidden_size input_forget layout"}},
    {"LayerNormalization",
     build_layer_normalization,
     {.most_inputs = 3, .most_outputs = 3, .attributes = "axis epsilon stash_type"}},
    {"LeakyRelu", build_leaky_relu, {.attributes = "alpha"}},
    {"Less", build_less, {.most_inputs = 2}},
    {"LessOrEqual", build_less_or_equal, {.most_inputs = 2}},
    {"Log", build_log, {}},
    {"MatMul", build_matmul, {.most_inputs = 2}},
    {"Max", build_max, {.most_inputs = any_number}},
    {"MaxPool",
     build_max_pool,
     {.most_outputs = 2, .attributes = "auto_pad ceil_mode dilations kernel_shape pads storage_order strides"}},
    {"Min", build_min, {.most_inputs = any_number}},
    {"Mod", build_mod, {.most_inputs = 2, .attributes = "fmod"}},
    {"Mul", build_mul, {.most_inputs = 2}},
    {"Neg", build_neg, {}},
    {"Pow", build_pow, {.most_inputs = 2}},
    {"Reciprocal", build_reciprocal, {}},
    {"ReduceL2", build_reduce_l2, {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"ReduceMean", build_reduce_mean, {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"ReduceSum", build_reduce_sum, {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"Relu", build_relu, {}},
    {"Reshape", build_reshape, {.most_inputs = 2, .attributes = "allowzero"}},
    {"Shape", build_shape, {.attributes = "start end"}},
    {"Sigmoid", build_sigmoid, {}},
    {"Sin", build_sin, {}},
    {"Slice", build_slice, {.most_inputs = 5, .attributes = "axes ends starts"}},
    {"Softmax", build_softmax, {.attributes = "axis"}},
    {"Softplus", build_softplus, {}},
    {"Split", build_split, {.most_inputs = 2, .most_outputs = any_number, .attributes = "axis split num_outputs"}},
    {"Sqrt", build_sqrt, {}},
    {"Squeeze", build_squeeze, {.most_inputs = 2, .attributes = "axes"}},
    {"Sub", build_sub, {.most_inputs = 2}},
    {"Tanh", build_tanh, {}},
    {"Transpose", build_transpose, {.attributes = "perm"}},
    {"Unsqueeze", build_unsqueeze, {.most_inputs = 2, .attributes = "axes"}},
    {"Where", build_where, {.most_inputs = 3}},
});

const Entry* find_entry(std::string_view op_type) {
  const auto* found = std::ranges::find(table, op_type, &Entry::op_type);
  return found == table.end() ? nullptr : found;
}

}  // namespace

BuildOperator find_operator(std::string_view op_type) {
  const Entry* entry = find_entry(op_type);
  return entry == nullptr ? nullptr : entry->build;
}

const OperatorForm& form_of(std::string_view op_type) {
  return find_entry(op_type)->form;
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
