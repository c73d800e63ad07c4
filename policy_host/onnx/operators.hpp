// The operators this engine evaluates: one table, one function per operator, one file per family.
#pragma once

#include <string>
#include <string_view>

#include "policy_host/onnx/builder.hpp"
#include "policy_host/onnx/node.hpp"

namespace takt::onnx_engine {

// Resolves the node's shapes, defines its outputs and adds its work; refuses what it cannot do.
using BuildOperator = void (*)(Builder&, const Node&);

BuildOperator find_operator(std::string_view op_type);  // null: not supported
std::string supported_operators();                      // comma-separated, for the refusal

// elementwise.cpp
void build_add(Builder&, const Node&);
void build_sub(Builder&, const Node&);
void build_mul(Builder&, const Node&);
void build_div(Builder&, const Node&);
void build_pow(Builder&, const Node&);
// activations.cpp
void build_sqrt(Builder&, const Node&);
void build_relu(Builder&, const Node&);
void build_elu(Builder&, const Node&);
void build_tanh(Builder&, const Node&);
void build_sigmoid(Builder&, const Node&);
void build_erf(Builder&, const Node&);
void build_leaky_relu(Builder&, const Node&);
void build_clip(Builder&, const Node&);
// matmul.cpp
void build_gemm(Builder&, const Node&);
void build_matmul(Builder&, const Node&);
// normalise.cpp
void build_reduce_mean(Builder&, const Node&);
void build_softmax(Builder&, const Node&);
void build_layer_normalization(Builder&, const Node&);
// views.cpp
void build_identity(Builder&, const Node&);
void build_reshape(Builder&, const Node&);
void build_flatten(Builder&, const Node&);
void build_squeeze(Builder&, const Node&);
void build_unsqueeze(Builder&, const Node&);
// rearrange.cpp
void build_transpose(Builder&, const Node&);
void build_slice(Builder&, const Node&);
void build_gather(Builder&, const Node&);
void build_expand(Builder&, const Node&);
void build_concat(Builder&, const Node&);
// constants.cpp
void build_constant(Builder&, const Node&);
void build_constant_of_shape(Builder&, const Node&);
void build_shape(Builder&, const Node&);
void build_cast(Builder&, const Node&);
// lstm.cpp, gru.cpp
void build_lstm(Builder&, const Node&);
void build_gru(Builder&, const Node&);

}  // namespace takt::onnx_engine
