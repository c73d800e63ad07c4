// SPDX-License-Identifier: Apache-2.0
// What holds a robot still against gravity, for tools beside the control loop. Set-up and tools only: allocates.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "config/robot_config.hpp"

namespace takt::pipeline {
class GravityModel;
}

namespace takt::commissioning {

class HoldingTorques {
 public:
  // Precondition: the robot has a model.
  explicit HoldingTorques(const config::RobotConfig& robot);
  ~HoldingTorques();
  HoldingTorques(const HoldingTorques&) = delete;
  HoldingTorques& operator=(const HoldingTorques&) = delete;

  // Nm, joint side, one per joint; `q` in rad, one per joint.
  [[nodiscard]] std::vector<double> at(std::span<const double> q) const;

 private:
  std::unique_ptr<pipeline::GravityModel> model_;
};

}  // namespace takt::commissioning
