// SPDX-License-Identifier: Apache-2.0
// What exporters of the mjlab and whole_body_tracking family leave in an ONNX file's metadata_props: lists separated by
// commas, joints in the policy's order. Read as written; a list that is not there stays empty, none is filled in.
//
// Units: rad, Nm/rad, Nms/rad. mjlab prints three decimals: what it says of gains and poses is rounded. Errors: one
// line. Thread rule: set-up only.
#pragma once

#include <expected>
#include <string>
#include <utility>
#include <vector>

#include "config/deploy_file.hpp"

namespace takt::policy_host {

struct ExporterMetadata {
  std::vector<std::string> joint_names;
  std::vector<double> stiffness, damping, default_position;  // one per joint, or empty
  std::vector<double> action_scale, action_offset;           // one, one per output, or empty
  std::vector<std::string> action_joints;                    // of each output; empty: not said
  std::vector<std::string> observation_names;                // as the author of the training called them
  std::vector<double> history_lengths;                       // one per observation, or empty
  bool rounded = false;                                      // all numbers have at most three decimals
};

// No joint_names: not such an exporter's, everything is empty.
std::expected<ExporterMetadata, std::string> read_exporter_metadata(
    const std::vector<std::pair<std::string, std::string>>& metadata);

// What it says for a robot file, whose joints are `robot_joints`, in the robot's own order. The period, what an
// observation is, its scale, and what else is not there stays unsaid. Errors: not such metadata, a list that is
// missing, or joints that are not the robot's.
std::expected<config::DeployFile, std::string> deploy_file_of(const ExporterMetadata& metadata,
                                                              const std::vector<std::string>& robot_joints);

}  // namespace takt::policy_host
