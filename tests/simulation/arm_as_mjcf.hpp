// SPDX-License-Identifier: Apache-2.0
// A serial arm's `model` as MJCF, for engines that read that.
#pragma once

#include <fmt/format.h>

#include <string>

#include "config/robot_config.hpp"

namespace takt::test {

inline std::string arm_as_mjcf(const config::RobotConfig& robot) {
  std::string bodies, ends;
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const config::Link& link = robot.model->links[j];
    const auto text = [](const config::Vector3& v) { return fmt::format("{} {} {}", v[0], v[1], v[2]); };
    bodies += fmt::format(R"(<body pos="{}" euler="{}"><inertial pos="{}" mass="{}" diaginertia="{}"/>)"
                          R"(<joint name="{}" axis="{}" armature="{}"/>)",
                          text(link.origin_xyz), text(link.origin_rpy), text(link.com), link.mass, text(link.inertia),
                          robot.joints[j].name, text(link.axis), robot.joints[j].inertia);
    ends += "</body>";
  }
  return R"(<mujoco><compiler angle="radian" eulerseq="XYZ"/><option timestep="0.0001" gravity="0 0 -9.81"/><worldbody>)" +
         bodies + ends + "</worldbody></mujoco>";
}

}  // namespace takt::test
