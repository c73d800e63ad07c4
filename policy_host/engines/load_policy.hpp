// SPDX-License-Identifier: Apache-2.0
// The policy of a robot file, by the engine that the file names, and the sampler around it where there is one
// (policy_host/flow): the one way in for everything that runs one (policy host, checks, rollouts).
//
// Engines: `builtin` (policy_host/onnx), and plugins (takt/engine.h): `onnxruntime`, `torchscript`, which lie beside
// the programs in lib/takt/engines, or a path. `auto` goes by the file alone, so that it says the same on every
// machine: TorchScript by its ending; ONNX by the built-in engine, but by ONNX Runtime what is beyond that (an
// operator, an attribute, a type, a size) and what has so many products of matrices that ONNX Runtime is the quicker.
// What is wrong with the file itself is refused whatever the engine. Errors: one line: what is wrong, its correction.
// Thread rule: set-up.
#pragma once

#include <expected>
#include <filesystem>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "policy_host/network.hpp"
#include "policy_host/onnx_engine/model.hpp"
#include "policy_host/policy.hpp"

namespace takt::policy_host {

// Precondition: check_policy_section passed.
std::expected<std::unique_ptr<Policy>, std::string> load_policy(const config::RobotConfig& robot);

// One network of it, `file`, as policy.engine says. Precondition: robot.policy.
std::expected<std::unique_ptr<Network>, std::string> load_network(const config::RobotConfig& robot,
                                                                  const std::filesystem::path& file);

// What `auto` takes for a file of a network, whether that engine is there or not.
struct EngineChoice {
  std::string name;  // "builtin", "onnxruntime", "torchscript"
  std::string why;   // of ONNX Runtime: why not the built-in one
};
std::expected<EngineChoice, std::string> choose_engine(const std::filesystem::path& file);

// What `auto` hands over to ONNX Runtime, and why.
bool is_quicker_elsewhere(const onnx_engine::Model& model);
std::string matrix_work_text(const onnx_engine::Model& model);

}  // namespace takt::policy_host
