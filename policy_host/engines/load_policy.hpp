// The policy of a robot file, by the engine that the file names, and the sampler around it where there is one
// (policy_host/flow): the one way in for everything that runs one (policy host, checks, rollouts).
//
// Engines: `builtin` (policy_host/onnx), and plugins (takt/engine.h): `onnxruntime`, `torchscript`, which lie beside
// the programs in lib/takt/engines, or a path. `auto` goes by the file alone, so that it says the same on every
// machine: TorchScript by its ending, ONNX by how much of it is products of matrices. Errors: one line: what is wrong,
// how to mend it. Thread rule: set-up.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "policy_host/onnx/model.hpp"
#include "policy_host/policy.hpp"

namespace takt::policy_host {

// Precondition: check_policy_section passed.
std::expected<std::unique_ptr<Policy>, std::string> load_policy(const config::RobotConfig& robot);

// What `auto` hands over to ONNX Runtime, and why.
bool is_quicker_elsewhere(const onnx_engine::Model& model);
std::string matrix_work_text(const onnx_engine::Model& model);

}  // namespace takt::policy_host
