// SPDX-License-Identifier: Apache-2.0
// A robot file's `model` of a published model (MJCF, URDF): what hangs on each joint, for the gravity that stops and
// holds carry. Base frame: MuJoCo's world. Each link's axes are the principal ones of what it carries, and its body's
// where those are principal. What no named joint moves counts with the link that carries it, as it stands at zero.
// SI units. Thread rule: any thread. A build without MuJoCo has none.
// Source: masses, centres and inertias that MuJoCo compiled; sums by the parallel axis theorem.
#pragma once

#include <expected>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"

namespace takt::simulation {

// One link per joint of `joints`, in that order. The tool is the centre of mass of the last one.
// None: the base is free, a joint is a ball, or a joint stands before one that carries it. Error: one sentence.
std::expected<std::optional<config::Model>, std::string> rigid_bodies(const std::string& path,
                                                                      const std::string& mesh_path,
                                                                      const std::vector<std::string>& joints);

}  // namespace takt::simulation
