// SPDX-License-Identifier: Apache-2.0
// The YAML of a LEAPP bundle (nvidia-isaac/leapp, configuration versions 1.1 to 1.3; Isaac Lab 3.0's export): which
// models it has, what each tensor means, what feeds what. What the file says, as values; nothing that it leaves out is
// filled in.
//
// Rules checked: every input of every node is fed exactly once, by the robot (pipeline.inputs), by another node
// (data_flow) or by the previous tick (feedback_flow; Isaac ROS Deploy writes feedback_connections); both ends of a
// flow exist and have one shape; names are names (config/exported_name.hpp). What the file leaves open, and what this
// reader knows nothing of, is in `notes`.
//
// Errors: one line per problem, "file:line:column: what; how to correct it". Thread rule: set-up only.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace takt::policy_host {

struct LeappTensor {
  std::string name;
  std::string dtype;  // "float32"
  std::vector<std::int64_t> shape;
  std::string kind;        // "state/joint/position"; "": the file does not say
  std::string connection;  // "state:robot:root_quat_w"; "": likewise
  // Of each dimension that has names, in order; empty: none. Quaternions are qx qy qz qw as named here.
  std::vector<std::vector<std::string>> element_names;
  bool temporal = false;                 // a dimension is time: an action chunk
  std::optional<std::size_t> time_axis;  // which one, where the file says it
  std::optional<double> temporal_period_ms;
};

// WBC-AGILE's addition: what its training knows of the joints, each list as long as joint_names or empty.
struct LeappArticulation {
  std::vector<std::string> joint_names;
  std::vector<double> default_position, stiffness, damping;
};

struct LeappNode {
  std::string name;
  std::vector<LeappTensor> inputs, outputs;  // in the model's positional order
  std::string model_path;                    // relative to the YAML
  std::string sha256, md5;                   // hex; "": not given
  std::string backend;                       // "onnx", "jit", "pt2"
  std::optional<int> opset;
};

struct LeappPort {
  std::string node, tensor;
  bool operator==(const LeappPort&) const = default;
};

struct LeappFlow {
  LeappPort from, to;
};

struct LeappBundle {
  std::vector<LeappNode> nodes;
  std::vector<LeappFlow> data_flow;  // within a tick
  std::vector<LeappFlow> feedback;   // into the next tick
  std::string initial_values;        // safetensors file with the feedback's start; "": none
  std::vector<LeappPort> inputs, outputs;
  std::optional<double> frequency_hz;
  std::string version;  // "leapp config version"
  std::optional<LeappArticulation> articulation;
  std::vector<std::string> notes;
};

// Has the two maps that make one; all else is for the reader.
bool is_leapp_bundle(std::string_view text);

std::expected<LeappBundle, std::string> read_leapp_bundle(std::string_view text, const std::string& name_for_messages);

}  // namespace takt::policy_host
