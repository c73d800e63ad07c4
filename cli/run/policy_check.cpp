// SPDX-License-Identifier: Apache-2.0
#include "cli/run/policy_check.hpp"

#include "config/bundle_name.hpp"
#include "config/observation_shape.hpp"
#include "policy_host/engines/load_policy.hpp"
#include "policy_host/fenced_load.hpp"
#include "policy_host/onnx_engine/model.hpp"
#include "policy_host/policy_fit.hpp"

namespace takt::cli {
namespace {

// What else a policy's file may be is between it and a program in the host's place.
bool is_the_policy_hosts(const config::Policy& policy) {
  const std::string& file = policy.file;
  if (policy.engine || file.ends_with(".onnx") || file.ends_with(".pt") || config::names_bundle(file)) return true;
  return onnx_engine::read_metadata(file).has_value();  // an ONNX file by another name
}

std::string refused_by_one_host(const config::RobotConfig& robot) {
  if (!is_the_policy_hosts(*robot.policy)) return {};
  if (const auto fine = policy_host::check_policy_section(robot); !fine) return fine.error();
  const auto loaded = policy_host::load_fenced(robot, 1, policy_host::load_policy);
  return loaded ? "" : loaded.error();
}

}  // namespace

std::string refused_by_policy_host(const config::RobotConfig& robot) {
  if (!robot.policy) return {};
  std::string refused = refused_by_one_host(robot);
  const config::Fallback* const fallback = config::fallback_policy_of(robot);
  if (!refused.empty() || fallback == nullptr) return refused;
  return refused_by_one_host(config::seen_by_fallback(robot, *fallback));
}

}  // namespace takt::cli
