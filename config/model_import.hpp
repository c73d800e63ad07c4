// SPDX-License-Identifier: Apache-2.0
// A robot file from a robot's model alone: joints, limits, inertias and where it begins are the model's. Buses, drives
// and the contract stay FILL_IN, or are made up where a simulated robot is asked for, as deploy_import.hpp says; there
// is no policy. Gains of a simulated robot are made up of inertias and torques, so that it holds where it begins.
#pragma once

#include <expected>
#include <string>

#include "config/deploy_import.hpp"

namespace takt::config {

// `options.model` is there; its policy_file and joint_names are not looked at. The error is one sentence.
std::expected<std::string, std::string> robot_of_model(ImportOptions options);

}  // namespace takt::config
