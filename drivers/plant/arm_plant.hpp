// The simulated arm: drives, encoders, gearing and rigid-body dynamics, stepped in virtual time, without I/O.
//
// Each step: encoders are read (quantised), every drive computes its torque from the newest command it has, the torque
// reaches the joint `simulation.torque_delay` later, the dynamics advance by `simulation.step`.
// Starts at the home pose, at rest, drives disabled and braked. Same inputs, same bits out.
// Units: joint side, rad, rad/s. Thread rule: one thread at a time.
#pragma once

#include <deque>
#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/can_bus.hpp"
#include "drivers/plant/arm_dynamics.hpp"
#include "drivers/plant/device.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::plant {

class ArmPlant {
 public:
  // The error is one sentence: no model, no simulation, a drive of another protocol.
  static std::expected<ArmPlant, std::string> make(const config::RobotConfig& robot);

  // Advances by simulation.step.
  void step();
  // Every drive of that bus hears the frame; what they answer is appended to `answers`. True: some drive answered.
  bool receive(std::size_t bus, const drivers::CanFrame& frame, Frames& answers);
  // What drives of that bus said by themselves since the last call.
  void collect(std::size_t bus, Frames& said);

  [[nodiscard]] MonoTime now() const { return now_; }  // virtual: 1 ns at start, so that it is set
  [[nodiscard]] Duration step_length() const { return step_; }
  [[nodiscard]] const ArmState& state() const { return state_; }
  void set_state(ArmState state) { state_ = std::move(state); }
  [[nodiscard]] config::Vector3 tool_position() { return dynamics_->tool_position(state_.q); }
  [[nodiscard]] ArmDynamics& dynamics() { return *dynamics_; }
  [[nodiscard]] Device& drive(std::size_t joint) { return *drives_[joint]; }
  [[nodiscard]] std::size_t joint_count() const { return drives_.size(); }

 private:
  ArmPlant(const config::RobotConfig& robot, std::unique_ptr<ArmDynamics> dynamics,
           std::vector<std::unique_ptr<Device>> drives);
  [[nodiscard]] MotorReading read_encoder(std::size_t joint) const;

  std::vector<config::Joint> joints_;
  config::Simulation simulation_;
  Duration step_;
  std::unique_ptr<ArmDynamics> dynamics_;
  std::vector<std::unique_ptr<Device>> drives_;
  std::vector<Frames> said_;  // per bus
  ArmState state_;
  std::deque<Eigen::VectorXd> on_their_way_;  // joint torques that have not reached their joints yet, oldest first
  MonoTime now_{1};
};

}  // namespace takt::plant
