// SPDX-License-Identifier: Apache-2.0
// The outside sensors that a simulation plays, from what is sensed to their mailboxes: the robot file's camera, the IMU
// of the mechanics, and a world's sensor and images; by way of what a scenario lets go wrong. A world's sensor takes
// the camera's place. What is not played here, a process of the user's plays.
// Thread rule: one thread at a time; readers are greeted by threads of its own. Errors: one sentence.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <expected>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "simulation/camera.hpp"
#include "simulation/outside_mechanics.hpp"
#include "simulation/robot_plant.hpp"
#include "simulation/scenario_player.hpp"
#include "simulation/sensor_path.hpp"

namespace takt::simulation {

class SimulatedSensors {
 public:
  // Serves the mailboxes in `directory`; `policy_user`: one more user who may read them. `started`: when the camera's
  // target was at the beginning of its path. `world`: that plays the robot, and outlives this; null: none.
  static std::expected<SimulatedSensors, std::string> open(const config::RobotConfig& robot,
                                                           const std::string& directory,
                                                           std::optional<uid_t> policy_user, MonoTime started,
                                                           RobotPlant& body, OutsideMechanics* world);

  // The scenario's event that strikes a sensor which is not played here, in one line. Empty: none.
  [[nodiscard]] std::string unplayed(const Scenario& scenario, const std::string& file) const;
  // What is sensed at `now`, and what has arrived by then.
  void look(RobotPlant& body, const ScenarioPlayer& scenario, MonoTime now);

 private:
  struct Mailbox {
    std::unique_ptr<ipc::SensorServer> server;  // null: not played
    SensorPath path;
  };
  SimulatedSensors(const config::RobotConfig& robot, MonoTime started, OutsideMechanics* world)
      : camera_(*robot.simulation, started), world_(world) {}

  Camera camera_;
  OutsideMechanics* world_;
  std::vector<Mailbox> mailboxes_;                      // one per sensor of the robot file
  std::optional<std::size_t> filmed_, imu_, of_world_;  // whose the camera, the IMU and the world's sensor are
  std::uint64_t imu_samples_ = 0;
};

}  // namespace takt::simulation
