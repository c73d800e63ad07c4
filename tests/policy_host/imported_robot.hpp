// SPDX-License-Identifier: Apache-2.0
// A simulated robot of `joints` hinges, joint_0 and so on, imported from the text of an export.
#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <string>

#include "config/deploy_file.hpp"
#include "config/deploy_import.hpp"
#include "config/load.hpp"
#include "config/model_facts.hpp"

namespace takt::policy_host {

// `step_dt`: of the policy, where the export does not say it. Throws what the import says.
inline config::RobotConfig imported_robot(const std::string& text, const std::string& source, std::size_t joints,
                                          Duration step_dt = {}) {
  config::ModelFacts model;
  for (std::size_t j = 0; j < joints; ++j)
    model.joints.push_back(
        {.name = fmt::format("joint_{}", j), .position = {{-3, 3}}, .velocity = {}, .torque = 50, .inertia = 0.1});
  auto deploy = config::read_deploy_file(text, source);
  if (!deploy) throw std::runtime_error(deploy.error());
  if (step_dt.ns != 0) deploy->step_dt = step_dt;
  const auto made = config::import_deploy_file(*deploy, {.robot = "r",
                                                         .policy_file = "p.onnx",
                                                         .joint_names = {},
                                                         .source = source,
                                                         .model = model,
                                                         .model_file = "m.xml",
                                                         .simulated = true});
  if (!made) throw std::runtime_error(made.error());
  auto robot = config::parse(*made, "r.yaml");
  if (!robot) throw std::runtime_error(robot.error());
  return *std::move(robot);
}

}  // namespace takt::policy_host
