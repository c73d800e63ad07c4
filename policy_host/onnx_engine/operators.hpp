// SPDX-License-Identifier: Apache-2.0
// The operators this engine evaluates: one table, one function per operator, one file per family.
#pragma once

#include <cstddef>
#include <string_view>

#include "policy_host/onnx_engine/builder.hpp"
#include "policy_host/onnx_engine/node.hpp"

namespace onnx {
class GraphProto;
}  // namespace onnx

namespace takt::onnx_engine {

// Resolves the node's shapes, defines its outputs and adds its work; refuses what it cannot do.
using BuildOperator = void (*)(Builder&, const Node&);

BuildOperator find_operator(std::string_view op_type);  // null: not supported

// What a node of an operator may have, of any opset that this engine takes. What each attribute means to which opset is
// the operator's own affair.
struct OperatorForm {
  std::size_t most_inputs = 1;
  std::size_t most_outputs = 1;
  std::string_view attributes = {};  // separated by blanks
};
const OperatorForm& form_of(std::string_view op_type);  // precondition: find_operator() knows it

// A graph's constants and nodes, in its order; its inputs must be there. branches.cpp
void build_graph(Builder&, const onnx::GraphProto&);

// elementwise.cpp
void build_sum(Builder&, const Node&);
void build_mean(Builder&, const Node&);
void build_prelu(Builder&, const Node&);
void build_add(Builder&, const Node&);
void build_sub(Builder&, const Node&);
void build_mul(Builder&, const Node&);
void build_div(Builder&, const Node&);
void build_pow(Builder&, const Node&);
void build_min(Builder&, const Node&);
void build_max(Builder&, const Node&);
void build_mod(Builder&, const Node&);
// select.cpp
void build_and(Builder&, const Node&);
void build_or(Builder&, const Node&);
void build_xor(Builder&, const Node&);
void build_equal(Builder&, const Node&);
void build_greater(Builder&, const Node&);
void build_greater_or_equal(Builder&, const Node&);
void build_less(Builder&, const Node&);
void build_less_or_equal(Builder&, const Node&);
void build_where(Builder&, const Node&);
// branches.cpp
void build_if(Builder&, const Node&);
// activations.cpp
void build_abs(Builder&, const Node&);
void build_neg(Builder&, const Node&);
void build_reciprocal(Builder&, const Node&);
void build_exp(Builder&, const Node&);
void build_log(Builder&, const Node&);
void build_sin(Builder&, const Node&);
void build_cos(Builder&, const Node&);
void build_softplus(Builder&, const Node&);
void build_gelu(Builder&, const Node&);
void build_sqrt(Builder&, const Node&);
void build_relu(Builder&, const Node&);
void build_elu(Builder&, const Node&);
void build_tanh(Builder&, const Node&);
void build_sigmoid(Builder&, const Node&);
void build_erf(Builder&, const Node&);
void build_leaky_relu(Builder&, const Node&);
void build_clip(Builder&, const Node&);
void build_selu(Builder&, const Node&);
void build_celu(Builder&, const Node&);
void build_hard_sigmoid(Builder&, const Node&);
void build_hard_swish(Builder&, const Node&);
void build_thresholded_relu(Builder&, const Node&);
void build_shrink(Builder&, const Node&);
void build_softsign(Builder&, const Node&);
void build_mish(Builder&, const Node&);
// functions.cpp
void build_acos(Builder&, const Node&);
void build_acosh(Builder&, const Node&);
void build_asin(Builder&, const Node&);
void build_asinh(Builder&, const Node&);
void build_atan(Builder&, const Node&);
void build_atanh(Builder&, const Node&);
void build_cosh(Builder&, const Node&);
void build_sinh(Builder&, const Node&);
void build_tan(Builder&, const Node&);
void build_ceil(Builder&, const Node&);
void build_floor(Builder&, const Node&);
void build_round(Builder&, const Node&);
void build_sign(Builder&, const Node&);
void build_not(Builder&, const Node&);
// matmul.cpp
void build_gemm(Builder&, const Node&);
void build_matmul(Builder&, const Node&);
// reduce.cpp
void build_reduce_l2(Builder&, const Node&);
void build_reduce_mean(Builder&, const Node&);
void build_reduce_sum(Builder&, const Node&);
void build_reduce_max(Builder&, const Node&);
void build_reduce_min(Builder&, const Node&);
void build_reduce_prod(Builder&, const Node&);
void build_reduce_l1(Builder&, const Node&);
void build_reduce_sum_square(Builder&, const Node&);
void build_reduce_log_sum(Builder&, const Node&);
void build_reduce_log_sum_exp(Builder&, const Node&);
void build_arg_max(Builder&, const Node&);
void build_arg_min(Builder&, const Node&);
void build_cum_sum(Builder&, const Node&);
// einsum.cpp
void build_einsum(Builder&, const Node&);
// convolution.cpp
void build_conv(Builder&, const Node&);
// transposed_convolution.cpp
void build_conv_transpose(Builder&, const Node&);
// pooling.cpp
void build_global_max_pool(Builder&, const Node&);
void build_average_pool(Builder&, const Node&);
void build_global_average_pool(Builder&, const Node&);
void build_max_pool(Builder&, const Node&);
// normalise.cpp
void build_batch_normalization(Builder&, const Node&);
void build_softmax(Builder&, const Node&);
void build_layer_normalization(Builder&, const Node&);
void build_log_softmax(Builder&, const Node&);
void build_hardmax(Builder&, const Node&);
void build_instance_normalization(Builder&, const Node&);
// views.cpp
void build_dropout(Builder&, const Node&);
void build_identity(Builder&, const Node&);
void build_reshape(Builder&, const Node&);
void build_flatten(Builder&, const Node&);
void build_squeeze(Builder&, const Node&);
void build_unsqueeze(Builder&, const Node&);
// rearrange.cpp
void build_transpose(Builder&, const Node&);
void build_slice(Builder&, const Node&);
void build_gather(Builder&, const Node&);
void build_split(Builder&, const Node&);
void build_expand(Builder&, const Node&);
void build_concat(Builder&, const Node&);
// layouts.cpp
void build_tile(Builder&, const Node&);
void build_pad(Builder&, const Node&);
void build_trilu(Builder&, const Node&);
void build_depth_to_space(Builder&, const Node&);
void build_space_to_depth(Builder&, const Node&);
// indices.cpp
void build_gather_elements(Builder&, const Node&);
void build_gather_nd(Builder&, const Node&);
void build_scatter_elements(Builder&, const Node&);
void build_scatter_nd(Builder&, const Node&);
void build_one_hot(Builder&, const Node&);
// constants.cpp
void build_size(Builder&, const Node&);
void build_range(Builder&, const Node&);
void build_cast_like(Builder&, const Node&);
void build_constant(Builder&, const Node&);
void build_constant_of_shape(Builder&, const Node&);
void build_shape(Builder&, const Node&);
void build_cast(Builder&, const Node&);
// lstm.cpp, gru.cpp
void build_lstm(Builder&, const Node&);
void build_gru(Builder&, const Node&);

}  // namespace takt::onnx_engine
