// SPDX-License-Identifier: Apache-2.0
// The dynamics of a whole robot, with the two points its task is about. Implementations: ArmDynamics, CartPoleDynamics,
// MujocoMechanics; the robot file says which.
#pragma once

#include <array>
#include <expected>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "simulation/dynamics.hpp"

namespace takt::simulation {

// What an inertial measurement unit on the robot reads.
struct ImuReading {
  std::array<double, 4> orientation{1, 0, 0, 0};  // w x y z, of the unit in the world; length 1
  std::array<double, 3> angular_velocity{};       // rad/s, in the unit's axes
  std::array<double, 3> acceleration{};           // m/s2, specific force in the unit's axes: 9.81 upwards at rest
};

// Where a robot's base is in the world: m, and w x y z of length 1.
struct BasePose {
  config::Vector3 position{};
  std::array<double, 4> orientation{1, 0, 0, 0};
};

class Mechanics : public Dynamics {
 public:
  // Where the world takes hold of the robot: an arm's tool, a pole's tip. m, base frame.
  [[nodiscard]] virtual config::Vector3 tool_position(const Eigen::VectorXd& q) = 0;
  // What the task wants at its target. m, base frame.
  [[nodiscard]] virtual config::Vector3 controlled_point(const Eigen::VectorXd& q) { return tool_position(q); }
  // Of now. Absent: the robot has none.
  [[nodiscard]] virtual std::optional<ImuReading> imu() { return std::nullopt; }
  // Of the root body. Absent: the mechanics know no base that moves.
  [[nodiscard]] virtual std::optional<BasePose> base() const { return std::nullopt; }
  // What a user should know about the model that was loaded: one sentence each.
  [[nodiscard]] virtual std::vector<std::string> notes() const { return {}; }
  // Whether a force or a mass can be put at the body of that name. Empty: at the tool, or at the root of a robot with a
  // base of its own.
  [[nodiscard]] virtual bool has_body(const std::string& name) const { return name.empty(); }
  // A force at that body, N, from the next step on, and at no other. False: these mechanics know joint torques only.
  // Precondition: has_body().
  virtual bool push(const config::Vector3& force, const std::string& body) {
    (void)force;
    (void)body;
    return false;
  }
  // A point mass at that body's centre of mass, kg, from the next step on, and at no other; 0: none. False: these
  // mechanics have no masses that change. Precondition: has_body().
  virtual bool load(double mass, const std::string& body) {
    (void)mass;
    (void)body;
    return false;
  }
};

// As its process publishes it: the ten values of executive/contract/imu.hpp, sensed and published at `at`.
SensorSample imu_sample(const ImuReading& reading, std::uint64_t sequence, MonoTime at);

// The error is one sentence: what the robot file lacks.
std::expected<std::unique_ptr<Mechanics>, std::string> make_mechanics(const config::RobotConfig& robot);

}  // namespace takt::simulation
