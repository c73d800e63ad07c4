// SPDX-License-Identifier: Apache-2.0
// A command chunk from the network's output: joint target = offset + scale * output, mapped to the robot's joints.
//
// Shapes: the output is steps * outputs_per_step values, step by step; then as many for each further output that the
// robot file names (config::named_outputs), taken as they are: velocities, stiffness, damping, torques. Joints that no
// output drives are told to stay at home, with their own gains. Step k is due k * step_period after the answered
// observation's publication. Fields:
//
// joint_position   q (rad); with cubic interpolation also dq (rad/s), by central differences of q over the steps
// joint_velocity   dq (rad/s), with no stiffness and the joint's own damping; q: as in the answered observation
// joint_torque     tau_ff (Nm), with no gains; q: as in the answered observation
// further          as named; a joint that no output drives keeps dq 0, its own gains and no torque
//
// Pure: no clock, no I/O, no allocation after construction. Thread rule: one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"

namespace takt::policy_host {

class ChunkBuilder {
 public:
  // Precondition: check_policy_section(robot) passed.
  ChunkBuilder(const config::RobotConfig& robot, std::uint64_t policy_hash);

  // Fills everything but the stamps, sequence and drop count. Precondition: outputs.size() == config::output_width().
  // The chunk has as many steps as the outputs mean: all, or fewer of a sampler that agreed on those alone.
  void fill(CommandChunk& chunk, const Observation& answered, std::span<const float> outputs) const;

 private:
  struct Output {
    std::size_t joint;
    float scale;
    float offset;  // rad; measured: added to the observed position
  };
  struct Idle {
    float home, kp, kd;  // rad, Nm/rad, Nms/rad: what a joint is told that no output drives
  };
  void fill_step(CommandChunk& chunk, const Observation& answered, std::size_t step,
                 std::span<const float> outputs) const;
  static void fill_velocities(CommandChunk& chunk);
  void fill_further(CommandChunk& chunk, std::size_t step, std::span<const float> outputs) const;

  config::ActionKind kind_;
  bool measured_, differentiates_;  // velocities by central differences of q
  bool agreed_;                     // its outputs may mean fewer steps than there are
  std::vector<Output> outputs_;
  std::vector<CommandField> further_;  // of each further output
  std::vector<Idle> idle_;             // per joint
  CommandHeader header_;               // the constant part
};

// What the `last_action` term shows: the raw actions of the previous chunk's step that is due when the new observation
// is published (the nearest one; the last one once the chunk is spent). For a policy without chunks that is simply its
// previous output. Zeros before the first chunk and after forget(). Of a chunk of fewer steps the last one stands on.
class LastAction {
 public:
  LastAction(const config::Policy& policy, std::size_t outputs_per_step);
  void remember(const Observation& answered, std::span<const float> outputs);
  void forget();
  [[nodiscard]] std::span<const float> due_at(MonoTime published_at) const;

 private:
  Duration step_period_;
  std::size_t width_;
  MonoTime answered_;  // published_at of the observation answered; unset: nothing remembered
  std::vector<float> outputs_;
};

}  // namespace takt::policy_host
