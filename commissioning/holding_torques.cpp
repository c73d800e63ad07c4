// SPDX-License-Identifier: Apache-2.0
#include "commissioning/holding_torques.hpp"

#include "executive/pipeline/gravity_model.hpp"
#include "executive/setup/tick_config_of.hpp"

namespace takt::commissioning {

HoldingTorques::HoldingTorques(const config::RobotConfig& robot) {
  const auto config = std::make_unique<pipeline::TickConfig>(setup::tick_config_of(robot, 0));
  model_ = std::make_unique<pipeline::GravityModel>(*config);
}

HoldingTorques::~HoldingTorques() = default;

std::vector<double> HoldingTorques::at(std::span<const double> q) const {
  const std::vector<float> narrow(q.begin(), q.end());
  std::vector<float> torques(q.size());
  model_->torques(narrow, torques);
  return {torques.begin(), torques.end()};
}

}  // namespace takt::commissioning
