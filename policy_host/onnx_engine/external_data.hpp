// SPDX-License-Identifier: Apache-2.0
// Weights that a model keeps in files beside itself, as exporters write them since models outgrew 2 GiB.
#pragma once

#include <filesystem>
#include <vector>

#include "policy_host/onnx_engine/model.hpp"

namespace onnx {
class ModelProto;
}

namespace takt::onnx_engine {

// Copies such data into the initializers that name it, each file read once. Throws Refusal unless every location is one
// of the files that the policy's hash covers (config::policy_files of `model_file`), a regular one in the model's own
// folder (symbolic links followed), offset and length lie within it, and all of it fits into a model. Thread rule:
// set-up only.
std::vector<ExternalFile> bring_in_external_data(onnx::ModelProto& model, const std::filesystem::path& model_file);

// For engines that bring it in themselves. Throws Refusal unless every location of a tensor, wherever in the model it
// stands (graphs within nodes, attributes, functions), is such a file. What is in these files is not looked at.
void vet_external_data(const onnx::ModelProto& model, const std::filesystem::path& model_file);

}  // namespace takt::onnx_engine
