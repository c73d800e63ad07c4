// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/operators.hpp"

#include <algorithm>
#include <array>

namespace takt::onnx_engine {

namespace {

struct Entry {
  std::string_view op_type;
  BuildOperator build;
  OperatorForm form;
};

constexpr std::size_t kAnyNumber = 1'000'000;

// Sorted, for the reader.
constexpr auto kOperators = std::to_array<Entry>({
    {"Abs", build_abs, {}},
    {"Acos", build_acos, {}},
    {"Acosh", build_acosh, {}},
    {"Add", build_add, {.most_inputs = 2}},
    {"And", build_and, {.most_inputs = 2}},
    {"ArgMax", build_arg_max, {.attributes = "axis keepdims select_last_index"}},
    {"ArgMin", build_arg_min, {.attributes = "axis keepdims select_last_index"}},
    {"Asin", build_asin, {}},
    {"Asinh", build_asinh, {}},
    {"Atan", build_atan, {}},
    {"Atanh", build_atanh, {}},
    {"AveragePool",
     build_average_pool,
     {.attributes = "auto_pad ceil_mode count_include_pad dilations kernel_shape pads strides"}},
    {"BatchNormalization",
     build_batch_normalization,
     {.most_inputs = 5, .attributes = "epsilon momentum spatial training_mode"}},
    {"Cast", build_cast, {.attributes = "to saturate"}},
    {"CastLike", build_cast_like, {.most_inputs = 2, .attributes = "saturate"}},
    {"Ceil", build_ceil, {}},
    {"Celu", build_celu, {.attributes = "alpha"}},
    {"Clip", build_clip, {.most_inputs = 3, .attributes = "min max"}},
    {"Concat", build_concat, {.most_inputs = kAnyNumber, .attributes = "axis"}},
    {"Constant",
     build_constant,
     {.most_inputs = 0,
      .attributes = "value value_float value_floats value_int value_ints value_string value_strings"}},
    {"ConstantOfShape", build_constant_of_shape, {.attributes = "value"}},
    {"Conv", build_conv, {.most_inputs = 3, .attributes = "auto_pad dilations group kernel_shape pads strides"}},
    {"ConvTranspose",
     build_conv_transpose,
     {.most_inputs = 3,
      .attributes = "auto_pad dilations group kernel_shape output_padding output_shape pads strides"}},
    {"Cos", build_cos, {}},
    {"Cosh", build_cosh, {}},
    {"CumSum", build_cum_sum, {.most_inputs = 2, .attributes = "exclusive reverse"}},
    {"DepthToSpace", build_depth_to_space, {.attributes = "blocksize mode"}},
    {"Div", build_div, {.most_inputs = 2}},
    {"Dropout", build_dropout, {.most_inputs = 3, .most_outputs = 2, .attributes = "ratio seed"}},
    {"Einsum", build_einsum, {.most_inputs = kAnyNumber, .attributes = "equation"}},
    {"Elu", build_elu, {.attributes = "alpha"}},
    {"Equal", build_equal, {.most_inputs = 2}},
    {"Erf", build_erf, {}},
    {"Exp", build_exp, {}},
    {"Expand", build_expand, {.most_inputs = 2}},
    {"Flatten", build_flatten, {.attributes = "axis"}},
    {"Floor", build_floor, {}},
    {"GRU",
     build_gru,
     {.most_inputs = 6,
      .most_outputs = 2,
      .attributes =
          "activation_alpha activation_beta activations clip direction hidden_size layout linear_before_reset"}},
    {"Gather", build_gather, {.most_inputs = 2, .attributes = "axis"}},
    {"GatherElements", build_gather_elements, {.most_inputs = 2, .attributes = "axis"}},
    {"GatherND", build_gather_nd, {.most_inputs = 2, .attributes = "batch_dims"}},
    {"Gelu", build_gelu, {.attributes = "approximate"}},
    {"Gemm", build_gemm, {.most_inputs = 3, .attributes = "alpha beta transA transB"}},
    {"GlobalAveragePool", build_global_average_pool, {}},
    {"GlobalMaxPool", build_global_max_pool, {}},
    {"Greater", build_greater, {.most_inputs = 2}},
    {"GreaterOrEqual", build_greater_or_equal, {.most_inputs = 2}},
    {"HardSigmoid", build_hard_sigmoid, {.attributes = "alpha beta"}},
    {"HardSwish", build_hard_swish, {}},
    {"Hardmax", build_hardmax, {.attributes = "axis"}},
    {"Identity", build_identity, {}},
    {"If", build_if, {.most_outputs = kAnyNumber, .attributes = "else_branch then_branch"}},
    {"InstanceNormalization", build_instance_normalization, {.most_inputs = 3, .attributes = "epsilon"}},
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
    {"LogSoftmax", build_log_softmax, {.attributes = "axis"}},
    {"MatMul", build_matmul, {.most_inputs = 2}},
    {"Max", build_max, {.most_inputs = kAnyNumber}},
    {"MaxPool",
     build_max_pool,
     {.most_outputs = 2, .attributes = "auto_pad ceil_mode dilations kernel_shape pads storage_order strides"}},
    {"Mean", build_mean, {.most_inputs = kAnyNumber}},
    {"Min", build_min, {.most_inputs = kAnyNumber}},
    {"Mish", build_mish, {}},
    {"Mod", build_mod, {.most_inputs = 2, .attributes = "fmod"}},
    {"Mul", build_mul, {.most_inputs = 2}},
    {"Neg", build_neg, {}},
    {"Not", build_not, {}},
    {"OneHot", build_one_hot, {.most_inputs = 3, .attributes = "axis"}},
    {"Or", build_or, {.most_inputs = 2}},
    {"PRelu", build_prelu, {.most_inputs = 2}},
    {"Pad", build_pad, {.most_inputs = 4, .attributes = "mode pads value"}},
    {"Pow", build_pow, {.most_inputs = 2}},
    {"Range", build_range, {.most_inputs = 3}},
    {"Reciprocal", build_reciprocal, {}},
    {"ReduceL1", build_reduce_l1, {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"ReduceL2", build_reduce_l2, {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"ReduceLogSum", build_reduce_log_sum, {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"ReduceLogSumExp",
     build_reduce_log_sum_exp,
     {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"ReduceMax", build_reduce_max, {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"ReduceMean", build_reduce_mean, {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"ReduceMin", build_reduce_min, {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"ReduceProd", build_reduce_prod, {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"ReduceSum", build_reduce_sum, {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"ReduceSumSquare",
     build_reduce_sum_square,
     {.most_inputs = 2, .attributes = "axes keepdims noop_with_empty_axes"}},
    {"Relu", build_relu, {}},
    {"Reshape", build_reshape, {.most_inputs = 2, .attributes = "allowzero"}},
    {"Round", build_round, {}},
    {"ScatterElements", build_scatter_elements, {.most_inputs = 3, .attributes = "axis reduction"}},
    {"ScatterND", build_scatter_nd, {.most_inputs = 3, .attributes = "reduction"}},
    {"Selu", build_selu, {.attributes = "alpha gamma"}},
    {"Shape", build_shape, {.attributes = "start end"}},
    {"Shrink", build_shrink, {.attributes = "bias lambd"}},
    {"Sigmoid", build_sigmoid, {}},
    {"Sign", build_sign, {}},
    {"Sin", build_sin, {}},
    {"Sinh", build_sinh, {}},
    {"Size", build_size, {}},
    {"Slice", build_slice, {.most_inputs = 5, .attributes = "axes ends starts"}},
    {"Softmax", build_softmax, {.attributes = "axis"}},
    {"Softplus", build_softplus, {}},
    {"Softsign", build_softsign, {}},
    {"SpaceToDepth", build_space_to_depth, {.attributes = "blocksize"}},
    {"Split", build_split, {.most_inputs = 2, .most_outputs = kAnyNumber, .attributes = "axis split num_outputs"}},
    {"Sqrt", build_sqrt, {}},
    {"Squeeze", build_squeeze, {.most_inputs = 2, .attributes = "axes"}},
    {"Sub", build_sub, {.most_inputs = 2}},
    {"Sum", build_sum, {.most_inputs = kAnyNumber}},
    {"Tan", build_tan, {}},
    {"Tanh", build_tanh, {}},
    {"ThresholdedRelu", build_thresholded_relu, {.attributes = "alpha"}},
    {"Tile", build_tile, {.most_inputs = 2}},
    {"Transpose", build_transpose, {.attributes = "perm"}},
    {"Trilu", build_trilu, {.most_inputs = 2, .attributes = "upper"}},
    {"Unsqueeze", build_unsqueeze, {.most_inputs = 2, .attributes = "axes"}},
    {"Where", build_where, {.most_inputs = 3}},
    {"Xor", build_xor, {.most_inputs = 2}},
});

const Entry* find_entry(std::string_view op_type) {
  const auto* found = std::ranges::find(kOperators, op_type, &Entry::op_type);
  return found == kOperators.end() ? nullptr : found;
}

}  // namespace

BuildOperator find_operator(std::string_view op_type) {
  const Entry* entry = find_entry(op_type);
  return entry == nullptr ? nullptr : entry->build;
}

const OperatorForm& form_of(std::string_view op_type) {
  return find_entry(op_type)->form;
}

}  // namespace takt::onnx_engine
