// SPDX-License-Identifier: Apache-2.0
// ONNX Runtime as a judge: its session behind the Network port with nothing in between, for what another engine made of
// the same file. Thread rule: as onnx_runtime.hpp.
#pragma once

#include <expected>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "policy_host/network.hpp"
#include "policy_host/onnx_runtime/onnx_runtime.hpp"

namespace takt::policy_trial {

// `known`: the network in the other engine, whose shapes count where the file leaves some open; null: the file says
// all.
std::expected<std::unique_ptr<policy_host::Network>, std::string> load_judging_network(
    const onnx_runtime::OnnxRuntime& judge, const std::filesystem::path& file, const policy_host::Network* known);

}  // namespace takt::policy_trial
