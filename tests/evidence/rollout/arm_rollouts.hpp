// SPDX-License-Identifier: Apache-2.0
// The demo arm's rollouts for tests: loaded once, a few seconds of virtual time each.
#pragma once

#include <memory>
#include <stdexcept>
#include <string_view>

#include "config/load.hpp"
#include "evidence/rollout/rollout.hpp"
#include "policy_host/onnx_policy.hpp"

namespace takt::lab::test {

inline const config::RobotConfig& arm() {
  static const config::RobotConfig robot = [] {
    auto loaded = config::load("config/arm6.yaml");
    if (!loaded) throw std::runtime_error(loaded.error());
    return *loaded;
  }();
  return robot;
}

inline policy_host::Policy& arm_policy() {
  static const auto policy = [] {
    auto loaded = policy_host::load_onnx_policy(arm().policy->file, arm().policy->input, arm().policy->output);
    if (!loaded) throw std::runtime_error(loaded.error());
    return std::move(*loaded);
  }();
  return *policy;
}

// 5 s; the perturbation acts from 2 s to 4 s, the last 3 s are scored.
inline evidence::RolloutSetup setup(std::string_view perturbation = "none", std::uint64_t seed = 1) {
  const trouble::Row* const kind = evidence::find_perturbation(perturbation);
  if (kind == nullptr) throw std::runtime_error("no such perturbation: " + std::string(perturbation));
  return {.robot = arm(),
          .policy = arm_policy(),
          .policy_hash = *config::policy_hash(arm().policy->file),
          .timing = {},
          .perturbation = {kind->as<evidence::Trouble>(), kind->dose.moderate, seconds(2), seconds(2)},
          .seed = seed,
          .duration = seconds(5),
          .scored = seconds(3),
          .bound_m = 0.02};
}

inline evidence::RolloutRow run(const evidence::RolloutSetup& wanted) {
  evidence::RolloutRow row;
  if (const auto done = evidence::run_rollout(wanted, row); !done) throw std::runtime_error(done.error());
  return row;
}
inline evidence::RolloutRow run(std::string_view perturbation, std::uint64_t seed = 1) {
  return run(setup(perturbation, seed));
}

}  // namespace takt::lab::test
