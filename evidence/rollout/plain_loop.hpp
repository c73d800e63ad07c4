// SPDX-License-Identifier: Apache-2.0
// The plain loop, the baseline of every panel: what a robot does without Takt between its policy and its drives. The
// newest command's target of the instant goes to each drive's own PD. No freshness, no limit, no pursuit, no barrier,
// no reserve for braking, no stop of its own: where no command comes, the newest one holds. A person arms it and stops
// it.
//
// In a rollout it takes the place of pipeline::control_tick and of the last guard; policy, delays, drives, buses and
// world are the same. It fills the same outputs, so that the same measures judge it: freshness and age in its records
// say how old the command was, and decide nothing. What the robot file says of the loop itself counts: period, gains
// where a command has none, interpolation (cubic: straight lines), gravity's torque where there is a model, and which
// side closes the loop. Joints are taken as the drives report them: no observer.
// Pure: no clock, input or output. Thread rule: one thread at a time.
#pragma once

#include <memory>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/feedback.hpp"
#include "executive/pipeline/command_in_use.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/gravity_model.hpp"
#include "executive/pipeline/observation_memory.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::evidence {

// What one drive is told `since` the chunk's step 0. `gravity`: Nm, the model's; `said`: the drive's newest reply.
// Preconditions: the chunk has a step, a period, field q and the joint; its values are finite.
pipeline::JointSetpoint plain_setpoint(const CommandChunk& chunk, Duration since, std::size_t joint, float gravity,
                                       const JointFeedback& said, const pipeline::TickConfig& config);

class PlainLoop {
 public:
  explicit PlainLoop(const pipeline::TickConfig& config);  // outlives this

  void tick(const pipeline::TickInput& input, pipeline::TickOutput& output);

 private:
  void take(const pipeline::PolicyMessage& message, TickRecordHeader& header);
  void change_mode(const pipeline::TickInput& input, TickRecordHeader& header);
  [[nodiscard]] bool all_enabled(const pipeline::TickInput& input) const;
  void set_joints(const pipeline::TickInput& input, pipeline::TickOutput& output) const;
  void publish(const pipeline::TickInput& input, pipeline::TickOutput& output);

  const pipeline::TickConfig& config_;
  pipeline::GravityModel gravity_;
  pipeline::ObservationMemory memory_;
  pipeline::CommandInUse command_;
  std::unique_ptr<CommandChunk> chunk_ = std::make_unique<CommandChunk>();  // its used part only
  std::uint64_t next_observation_ = 0;                                      // in observation periods since the start
  Mode mode_ = Mode::standby;
};

}  // namespace takt::evidence
