// SPDX-License-Identifier: Apache-2.0
// Does a robot file feed a policy what its exporter says that it needs, and send what it says where that belongs?
//
// Inputs: of joints, the joints by name and in order; of the base, the frame and the quaternion's order; of a sensor,
// the unit and the frame that the exporter's kind or name fixes; SI units as they are. Outputs: each goes somewhere,
// for the joints it is for; chunks and periods agree. What the exporter leaves open the robot file decides. Errors: one
// line, what contradicts what and how to correct it.
#pragma once

#include <expected>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "policy_host/described_policy.hpp"

namespace takt::policy_host {

// Preconditions: robot.policy; its terms fill the inputs one after the other, in the order of policy.input (or of
// `said`, where that is empty).
std::expected<void, std::string> check_binding(const DescribedPolicy& said, const config::RobotConfig& robot);

// What each input is bound to, as bound_terms.hpp says it. Preconditions as above, and check_binding passed.
std::vector<std::string> binding_lines(const DescribedPolicy& said, const config::RobotConfig& robot);

}  // namespace takt::policy_host
