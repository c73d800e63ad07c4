// Writes a robot file from a deploy.yaml: everything it knows is carried over; what it cannot know (drives, CAN ids,
// limits, inertias, the freshness contract) is written as FILL_IN, which the loader refuses key by key until a person
// has replaced it. Nothing about the hardware is invented.
#pragma once

#include <expected>
#include <string>
#include <vector>

#include "config/deploy_file.hpp"

namespace takt::config {

struct ImportOptions {
  std::string robot;                     // name of the robot
  std::string policy_file;               // as it shall stand in the file
  std::vector<std::string> joint_names;  // the robot's order; empty: joint_00, joint_01, ...
  std::string source;                    // for the first comment
};

// Text of the robot file; the error is one sentence about the options.
std::expected<std::string, std::string> import_deploy_file(const DeployFile& deploy, const ImportOptions& options);

}  // namespace takt::config
