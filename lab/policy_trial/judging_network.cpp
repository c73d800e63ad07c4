// SPDX-License-Identifier: Apache-2.0
#include "lab/policy_trial/judging_network.hpp"

#include <stdexcept>
#include <utility>
#include <vector>

namespace takt::policy_trial {
namespace {

using onnx_engine::TensorInfo;
using onnx_runtime::Tensor;

std::vector<TensorInfo> infos_of(std::span<const Tensor> tensors) {
  std::vector<TensorInfo> infos;
  for (const Tensor& tensor : tensors) infos.push_back({tensor.name, tensor.shape});
  return infos;
}

std::vector<Tensor> tensors_of(std::span<const TensorInfo> infos) {
  std::vector<Tensor> tensors;
  for (const TensorInfo& info : infos) tensors.push_back({info.name, info.shape, {}});
  return tensors;
}

class JudgingNetwork final : public policy_host::Network {
 public:
  explicit JudgingNetwork(onnx_runtime::Session session)
      : session_(std::move(session)), inputs_(infos_of(session_.inputs())), outputs_(infos_of(session_.outputs())) {}

  [[nodiscard]] std::span<const TensorInfo> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const TensorInfo> outputs() const override { return outputs_; }
  std::span<float> input(std::size_t i) override { return session_.inputs()[i].values; }
  [[nodiscard]] std::span<const float> output(std::size_t i) const override { return session_.outputs()[i].values; }
  void run() override {
    if (const auto ran = session_.run(); !ran) throw std::runtime_error(ran.error());
  }

 private:
  mutable onnx_runtime::Session session_;  // its tensors are where they are, whatever reads them
  std::vector<TensorInfo> inputs_, outputs_;
};

}  // namespace

std::expected<std::unique_ptr<policy_host::Network>, std::string> load_judging_network(
    const onnx_runtime::OnnxRuntime& judge, const std::filesystem::path& file, const policy_host::Network* known) {
  auto session =
      known == nullptr ? judge.load(file) : judge.load(file, tensors_of(known->inputs()), tensors_of(known->outputs()));
  if (!session) return std::unexpected(session.error());
  return std::make_unique<JudgingNetwork>(*std::move(session));
}

}  // namespace takt::policy_trial
