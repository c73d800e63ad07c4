// The dynamics of a whole robot, with the two points its task is about. Implementations: ArmDynamics, CartPoleDynamics;
// the robot file says which.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "simulation/dynamics.hpp"

namespace takt::plant {

class Mechanics : public Dynamics {
 public:
  // Where the world takes hold of the robot: an arm's tool, a pole's tip. m, base frame.
  [[nodiscard]] virtual config::Vector3 tool_position(const Eigen::VectorXd& q) = 0;
  // What the task wants at its target. m, base frame.
  [[nodiscard]] virtual config::Vector3 controlled_point(const Eigen::VectorXd& q) { return tool_position(q); }
};

// The error is one sentence: what the robot file lacks.
std::expected<std::unique_ptr<Mechanics>, std::string> make_mechanics(const config::RobotConfig& robot);

}  // namespace takt::plant
