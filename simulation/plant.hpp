// SPDX-License-Identifier: Apache-2.0
// Drives, encoders and gearing in front of some mechanics, stepped in virtual time, without I/O.
//
// Each step: encoders are read (quantised), every drive computes its torque from the newest command it has, the torque
// reaches the joint `simulation.torque_delay` later, the dynamics advance by `simulation.step`.
// A passive joint moves freely, whatever its drive wants; while the drive is disabled, a hand holds it where it is. A
// robot with a base of its own hangs on a hoist until all drives are enabled; from then on it stands or falls by
// itself, whatever becomes of its drives, until all of them have been disabled for kTakenUpAfter: then a hoist has
// hung it where it began. Starts at the home pose, at rest, drives disabled and braked. Same inputs, same bits out.
// Units: joint side, rad, rad/s, Nm; of a slide m, m/s, N. Thread rule: one thread at a time.
#pragma once

#include <deque>
#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/bus/can_bus.hpp"
#include "executive/contract/mono_time.hpp"
#include "simulation/device.hpp"
#include "simulation/dynamics.hpp"
#include "simulation/reply_path.hpp"

namespace takt::simulation {

// Longer than a fall takes of a robot whose joints are braked.
inline constexpr Duration kTakenUpAfter = seconds(3);

// `joint_friction` as it acts on this joint: on a slide through its gear.
Friction friction_of(const config::Simulation& simulation, const config::Joint& joint);

class Plant {
 public:
  // Of `robot`: buses, joints and simulation. The error is one sentence: no simulation, a drive that no device plays.
  static std::expected<Plant, std::string> make(const config::RobotConfig& robot, std::unique_ptr<Dynamics> dynamics);
  // Every drive on a flywheel of its joint's `inertia`.
  static std::expected<Plant, std::string> on_free_inertias(const config::RobotConfig& robot);

  // Advances by simulation.step.
  void step();
  // Every drive of that bus hears the frame; what arrives of their answers is appended to `answers`. True: some drive
  // answered.
  bool receive(std::size_t bus, const drivers::CanFrame& frame, Frames& answers);
  // What else drives of that bus said: by themselves, or late.
  void collect(std::size_t bus, Frames& said);
  void set_line(std::size_t joint, const LineFaults& faults);

  [[nodiscard]] MonoTime now() const { return now_; }  // virtual: 1 ns at start, so that it is set
  [[nodiscard]] Duration step_length() const { return simulation_.step; }
  [[nodiscard]] const ArmState& state() const { return state_; }
  void set_state(ArmState state) { state_ = std::move(state); }
  [[nodiscard]] Device& drive(std::size_t joint) { return *joints_[joint].device; }
  [[nodiscard]] std::size_t joint_count() const { return joints_.size(); }
  [[nodiscard]] std::size_t bus_of(std::size_t joint) const { return joints_[joint].settings.bus; }

 private:
  struct PlantJoint {
    config::Joint settings;
    std::unique_ptr<Device> device;
    ReplyPath replies;
  };
  // What a step needs to know of a joint, of its settings.
  struct Gearing {
    double ratio, offset;   // motor angle per joint angle, with the direction's sign; rad, joint side
    double braking_torque;  // Nm
    double encoder_step;    // rad, joint side
    Friction friction;
    bool passive;
  };
  Plant(const config::Simulation& simulation, std::vector<PlantJoint> joints, std::unique_ptr<Dynamics> dynamics);
  [[nodiscard]] MotorReading read_encoder(std::size_t joint) const;
  double update_drive(std::size_t joint, Duration step);  // motor side torque
  void attend_hoist(std::size_t disabled);                // drives

  config::Simulation simulation_;
  std::vector<PlantJoint> joints_;
  std::vector<Gearing> gearing_;                  // by joint
  std::vector<std::vector<std::size_t>> on_bus_;  // the joints of each bus
  std::unique_ptr<Dynamics> dynamics_;
  Frames said_;                     // work space, as are the next two
  std::vector<Friction> friction_;  // by joint
  Eigen::VectorXd spare_;           // torques that have reached their joints
  ArmState state_;
  bool hangs_ = true;                         // the base, on its hoist
  MonoTime disabled_since_;                   // all drives; unset: some are enabled
  std::deque<Eigen::VectorXd> on_their_way_;  // joint torques that have not reached their joints yet, oldest first
  MonoTime now_{1};
};

}  // namespace takt::simulation
