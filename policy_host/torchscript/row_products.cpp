// SPDX-License-Identifier: Apache-2.0
#include "policy_host/torchscript/row_products.hpp"

#include <torch/csrc/jit/passes/inliner.h>
#include <torch/csrc/jit/runtime/custom_operator.h>

#include <vector>

namespace takt::torchscript {
namespace {

constexpr const char* kLayer = "takt::linear";

at::Tensor layer(const at::Tensor& x, const at::Tensor& weight, const c10::optional<at::Tensor>& bias) {
  if (x.dim() == 0 || x.numel() != x.size(-1) || x.size(-1) != weight.size(-1)) return at::linear(x, weight, bias);
  const at::Tensor row = x.reshape({-1});
  const at::Tensor product = bias ? at::addmv(*bias, weight, row) : at::mv(weight, row);
  std::vector<std::int64_t> shape = x.sizes().vec();
  shape.back() = weight.size(0);
  return product.view(shape);
}

void run_linear(torch::jit::Stack& stack) {
  auto bias = torch::jit::pop(stack).toOptional<at::Tensor>();
  const at::Tensor weight = torch::jit::pop(stack).toTensor();
  const at::Tensor x = torch::jit::pop(stack).toTensor();
  torch::jit::push(stack, layer(x, weight, bias));
}

const torch::jit::RegisterOperators kOperators({torch::jit::Operator(
    "takt::linear(Tensor x, Tensor weight, Tensor? bias) -> Tensor", run_linear, c10::AliasAnalysisKind::FROM_SCHEMA)});

void rewrite(torch::jit::Block* block) {  // NOLINT(misc-no-recursion): as deep as the script
  for (torch::jit::Node* const node : block->nodes()) {
    for (torch::jit::Block* const inner : node->blocks()) rewrite(inner);
    if (node->kind() == c10::aten::linear) node->replaceWithNewSymbol(c10::Symbol::fromQualString(kLayer));
  }
  for (auto node = block->nodes().begin(); node != block->nodes().end();) {
    torch::jit::Node* const one = *node;
    ++node;
    if (one->kind() == c10::aten::linear) one->destroy();
  }
}

}  // namespace

void multiply_rows_as_vectors(torch::jit::Module& module) {
  const auto graph = module.get_method("forward").graph();
  torch::jit::Inline(*graph);
  rewrite(graph->block());
}

}  // namespace takt::torchscript
