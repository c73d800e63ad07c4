// Mechanics that another process plays (world_link.hpp). Begins where that process says, after a reset with the robot
// file's seed and home pose. When the world ends, the robot stops where it was and stays there; end() says why.
//
// The tool is the point that the world controls, (0, 0, 0) where it gives none, and only of the latest state: forces
// and masses at the tool are the world's own affair. The robot file's `model` is not used.
// Units: joint side, rad, rad/s, Nm. Thread rule: one thread at a time.
#pragma once

#include <expected>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "simulation/mechanics.hpp"
#include "simulation/world_link.hpp"

namespace takt::plant {

class OutsideMechanics final : public Mechanics {
 public:
  static std::expected<std::unique_ptr<OutsideMechanics>, WorldEnd> connect(const config::RobotConfig& robot,
                                                                            const std::string& path,
                                                                            const WorldLink::Patience& patience = {});

  void integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                 Duration step) override;
  [[nodiscard]] config::Vector3 tool_position(const Eigen::VectorXd& q) override;
  // Of worlds that give one.
  [[nodiscard]] std::optional<ImuReading> imu() override { return imu_; }

  [[nodiscard]] ArmState begin() const { return begin_; }
  [[nodiscard]] const std::optional<WorldEnd>& end() const { return end_; }
  [[nodiscard]] const WorldLink& link() const { return link_; }

 private:
  OutsideMechanics(WorldLink link, const takt_world_state& first, std::size_t joint_count);

  WorldLink link_;
  ArmState begin_;
  config::Vector3 point_{};
  std::optional<ImuReading> imu_;
  std::vector<double> viscous_, coulomb_;  // work space
  std::optional<WorldEnd> end_;
};

}  // namespace takt::plant
