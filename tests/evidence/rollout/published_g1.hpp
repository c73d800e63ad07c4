// SPDX-License-Identifier: Apache-2.0
// Unitree's G1 as `takt config import --simulated` writes it from the published files, where ../shared has them.
#pragma once

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "config/deploy_import.hpp"
#include "config/document.hpp"
#include "simulation/model_survey.hpp"

namespace takt::lab::test {

inline const std::string kG1Model = "../shared/robots/g1/g1_29dof.xml", kG1Policy = "../shared/policies/g1_velocity/";

// A published policy's deploy.yaml and network.
struct Published {
  std::string deploy, network;
};
inline const Published kG1Walker{kG1Policy + "deploy.yaml", kG1Policy + "policy.onnx"};
inline const Published kG1OfMjlab{"../shared/policies/g1_mjlab_velocity/params/deploy.yaml",
                                  "../shared/policies/g1_mjlab_velocity/exported/policy.onnx"};

inline void import_g1(const std::string& robot_file, const Published& from = kG1Walker) {
  const auto deploy = config::read_deploy_file(config::read_file(from.deploy).value(), "deploy.yaml");
  if (!deploy) throw std::runtime_error(deploy.error());
  const auto text = config::import_deploy_file(*deploy, {.robot = "g1",
                                                         .policy_file = std::filesystem::absolute(from.network),
                                                         .joint_names = {},
                                                         .source = "deploy.yaml",
                                                         .model = simulation::survey_model(kG1Model).value(),
                                                         .model_file = std::filesystem::absolute(kG1Model),
                                                         .simulated = true});
  if (!text) throw std::runtime_error(text.error());
  std::ofstream(robot_file) << *text;
}

}  // namespace takt::lab::test
