// SPDX-License-Identifier: Apache-2.0
// The stabiliser, frozen: the real decision, the real drivers and the simulated drives hold one pose in virtual time,
// while a torque is injected at one joint. No policy takes part; the command is the pose, for ever, and always fresh.
// Deterministic. Thread rule: one thread at a time.
#pragma once

#include <Eigen/Core>
#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "evidence/rollout/perturbation.hpp"
#include "evidence/rollout/virtual_bus.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "lab/study/probed_dynamics.hpp"

namespace takt::study {

class HoldingLoop {
 public:
  // Powers on at `pose`, arms, and waits until the robot rests. The error is one sentence: what the simulation lacks,
  // why it does not arm, or that the loop does not come to rest. `robot` outlives this.
  static std::expected<std::unique_ptr<HoldingLoop>, std::string> make(const config::RobotConfig& robot,
                                                                       std::unique_ptr<simulation::Dynamics> dynamics,
                                                                       const Eigen::VectorXd& pose);
  HoldingLoop(const HoldingLoop&) = delete;
  HoldingLoop& operator=(const HoldingLoop&) = delete;

  [[nodiscard]] ProbedDynamics& probe() { return probe_; }
  void run(Duration span);
  // Empty, or what disturbed the stabiliser since the last call: it left tracking, or a limit intervened.
  [[nodiscard]] std::string trouble();

 private:
  HoldingLoop(const config::RobotConfig& robot, simulation::Plant plant, ProbedDynamics& probe,
              const Eigen::VectorXd& pose);
  std::expected<void, std::string> arm();
  void tick();
  void answer(const Observation& observation);
  [[nodiscard]] double fastest() const;

  const config::RobotConfig& robot_;
  evidence::Disturbance undisturbed_;
  pipeline::TickConfig config_;
  pipeline::TickStatePtr state_;
  simulation::Plant plant_;
  ProbedDynamics& probe_;  // the plant's
  std::unique_ptr<evidence::VirtualBus> bus_;
  std::unique_ptr<CommandChunk> chunk_ = std::make_unique<CommandChunk>();
  std::unique_ptr<pipeline::TickOutput> output_ = std::make_unique<pipeline::TickOutput>();
  pipeline::TickInput input_;
  MonoTime due_, plant_at_;
  bool answered_ = false;  // the chunk waits for the next tick
  std::string trouble_;
};

}  // namespace takt::study
