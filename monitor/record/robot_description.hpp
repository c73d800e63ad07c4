// SPDX-License-Identifier: Apache-2.0
// The robot file's `model` for viewers: as a URDF, and where its links stand at the joints' angles. Frames: `base`, and
// for each joint JOINT_link, which turns or slides with it; at zero angle it lies as the robot file's `origin` says.
// Lengths are m, angles rad. Source: the URDF XML specification (wiki.ros.org/urdf/XML): fixed-axis roll, pitch, yaw,
// the joint's axis in the child's frame. Thread rule: any thread.
#pragma once

#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"
#include "monitor/record/standard_messages.hpp"

namespace takt::monitor {

// Joints with axis and limits, links with mass and inertia, and a cylinder from each joint to the next. A link without
// mass has no inertial. Precondition: robot.model.
std::string robot_description(const config::RobotConfig& robot);

// Every link in its parent's frame, by the measured angles; a link is left out whose angle is not finite.
// Precondition: robot.model, and the record is of this robot.
std::vector<FrameTransform> frame_transforms(const config::RobotConfig& robot, const TickRecord& record);

}  // namespace takt::monitor
