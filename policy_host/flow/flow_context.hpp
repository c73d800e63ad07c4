// SPDX-License-Identifier: Apache-2.0
// What a sampler is shown behind the observation: the numbers that its noise is drawn from, and the path that is being
// played. Part of the policy's input, so that the recorded input alone says what the answer must be, bit for bit.
//
//   id         3 values: the observation's id in digits of 2^24, lowest first
//   promised   steps of the path that will be played whatever the answer is (Observation::committed_count)
//   known      steps that the path still has; 0: there is none, or it is not of this policy's answers
//   path       steps * outputs values: the path's step for the instant of each step of the new chunk, as the outputs
//              that the policy would say for it. Beyond `known` its last step stands on, never zeros
//
// Pure. Thread rule: one thread; no allocation after construction.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/observation.hpp"

namespace takt::policy_host {

struct FlowContext {
  static constexpr std::size_t kCounts = 5;

  std::uint64_t observation_id = 0;
  std::size_t promised = 0, known = 0;
  std::span<const float> path;

  // Steps that a chunk is to begin with where it must be exact: the promised ones, and one more where the path has it.
  // If the answer comes in time, that one is the same step of the same path; if it comes up to a step late, it has been
  // played.
  [[nodiscard]] std::size_t kept() const { return promised == 0 ? 0 : std::min(promised + 1, known); }

  // `values`: kCounts and the path's, as FlowMemory::show() writes them; they may come from a file that another program
  // wrote. promised <= known <= steps, whatever they say.
  static FlowContext read(std::span<const float> values, std::size_t steps);
};

// Whose answers the observations speak of (Observation::command_sequence).
enum class PathOwner : std::uint8_t { policy, candidate, nobody };

// The newest answers of a session, of which one is being played.
class FlowMemory {
 public:
  // Precondition: robot.policy->sampler.
  FlowMemory(const config::RobotConfig& robot, PathOwner owner);

  void start_session();
  // `sequence`: 1, 2, 3, ... of a session, not all of them need to be remembered. `outputs`: of the steps that are
  // meant.
  void remember(std::uint64_t sequence, const Observation& answered, std::span<const float> outputs);
  // Writes config::flow_context_width(robot) values.
  void show(const Observation& observation, std::span<float> values) const;
  // The newest answer is on its way: what this observation promises, it may break. It is given up when its chunk would
  // be spent.
  [[nodiscard]] bool awaits(const Observation& observation) const;

 private:
  struct Answer {
    std::uint64_t sequence = 0;  // 0: none
    MonoTime begins;             // of its first step
    std::array<float, kMaxJoints> measured{};
    std::size_t steps = 0;
    std::vector<float> outputs;
  };
  [[nodiscard]] const Answer* played(const Observation& observation) const;
  [[nodiscard]] bool speaks_of_us(const Observation& observation) const;
  [[nodiscard]] float moved(const Answer& answer, const Observation& observation, std::size_t output) const;

  static constexpr std::size_t kRemembered = 16;
  PathOwner owner_;
  Duration step_period_;
  bool held_;      // between steps the path stands
  bool measured_;  // outputs are relative to the position in their own observation
  std::size_t steps_, width_;
  struct Output {
    std::size_t joint;
    float scale;
  };
  std::vector<Output> outputs_;
  std::vector<Answer> answers_;
  std::uint64_t newest_ = 0;
};

}  // namespace takt::policy_host
