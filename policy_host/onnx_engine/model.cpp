// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/model.hpp"

#include <utility>

#include "policy_host/onnx_engine/program.hpp"

namespace takt::onnx_engine {

Model::Model(std::unique_ptr<Program> program) noexcept : program_(std::move(program)) {}
Model::Model(Model&&) noexcept = default;
Model& Model::operator=(Model&&) noexcept = default;
Model::~Model() = default;

std::span<const TensorInfo> Model::inputs() const noexcept {
  return program_->input_info;
}
std::span<const TensorInfo> Model::outputs() const noexcept {
  return program_->output_info;
}
std::span<float> Model::input(std::size_t i) noexcept {
  return program_->inputs[i];
}
std::span<const float> Model::output(std::size_t i) const noexcept {
  return program_->outputs[i];
}

std::int64_t Model::opset() const noexcept {
  return program_->opset;
}
const OperatorCounts& Model::operators() const noexcept {
  return program_->operators;
}
std::span<const ExternalFile> Model::external_files() const noexcept {
  return program_->external_files;
}
const Metadata& Model::metadata() const noexcept {
  return program_->metadata;
}
std::span<const std::string> Model::lost_states() const noexcept {
  return program_->lost_states;
}

std::uint64_t Model::matrix_work() const noexcept {
  return program_->matrix_work;
}

std::size_t Model::steps() const noexcept {
  return program_->steps.size();
}

void Model::run() noexcept {
  for (const std::unique_ptr<Step>& step : program_->steps) step->run();
}

}  // namespace takt::onnx_engine
