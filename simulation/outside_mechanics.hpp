// SPDX-License-Identifier: Apache-2.0
// Mechanics that another process plays (world_link.hpp). Begins where that process says, after a reset with a seed and
// the robot file's home pose. When the world ends, the robot stops where it was and stays there; end() says why.
//
// The tool is the point that the world controls, (0, 0, 0) where it gives none, and only of the latest state. A push is
// told to a world that gives TAKT_WORLD_PUSH; masses are the world's own affair. The robot file's `model` is not used.
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

namespace takt::simulation {

class OutsideMechanics final : public Mechanics {
 public:
  // `seed`: of everything that the world draws.
  static std::expected<std::unique_ptr<OutsideMechanics>, WorldEnd> connect(const config::RobotConfig& robot,
                                                                            const std::string& path, std::uint64_t seed,
                                                                            const WorldLink::Patience& patience = {});

  void integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                 Duration step) override;
  [[nodiscard]] config::Vector3 tool_position(const Eigen::VectorXd& q) override;
  // Of worlds that give one.
  [[nodiscard]] std::optional<ImuReading> imu() override;
  [[nodiscard]] std::optional<BasePose> base() const override;
  bool push(const config::Vector3& force, const std::string& body) override;
  void hoist(bool hangs) override { hangs_ = hangs; }
  // The newest sample of the world's sensor that was not returned before, as old as the state that had it first.
  [[nodiscard]] std::optional<SensorSample> sample(MonoTime now);
  struct Image {
    std::size_t sensor = 0;  // index into the robot file's
    Sensed sensed;
  };
  // Of each of the world's cameras the newest image that was not returned before, as old as the world says.
  [[nodiscard]] std::vector<Image> images(MonoTime now);
  // Whether its states have images of that sensor of the robot file.
  [[nodiscard]] bool films(std::size_t sensor) const;
  // The task's, m; 0 of a world that gives none.
  [[nodiscard]] double error() const;

  [[nodiscard]] ArmState begin() const { return begin_; }
  [[nodiscard]] const std::optional<WorldEnd>& end() const { return end_; }
  [[nodiscard]] const WorldLink& link() const { return link_; }

 private:
  OutsideMechanics(WorldLink link, const takt_world_state& first, std::size_t joint_count,
                   std::vector<std::size_t> sensor_of_camera);
  void keep_images();

  WorldLink link_;
  ArmState begin_;
  takt_world_state state_;                 // the latest
  std::vector<double> viscous_, coulomb_;  // work space
  config::Vector3 push_{};
  bool hangs_ = false;
  Duration sensed_{};                          // the sensor's newest sample, since the reset
  std::uint64_t sampled_ = 0;                  // sequence of the sensor's sample that was returned last
  std::vector<std::size_t> sensor_of_camera_;  // index into the robot file's sensors, of each of the link's cameras
  std::vector<WorldImage> images_;             // at most one per camera
  std::optional<WorldEnd> end_;
};

}  // namespace takt::simulation
