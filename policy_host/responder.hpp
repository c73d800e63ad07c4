// One observation in, one command chunk out: input vector, inference, joint targets, stamps. Everything a policy host
// does between reading and publishing, without the reading and publishing.
//
// Forgets the past (histories, last action, hidden state) where an observation does not go on from the last
// (continuity.hpp), and after an output that is not finite. Time comes from the clock passed in. Thread rule: one
// thread; no allocation.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "policy_host/chunk_builder.hpp"
#include "policy_host/continuity.hpp"
#include "policy_host/observation_builder.hpp"
#include "policy_host/policy.hpp"

namespace takt::policy_host {

using Clock = MonoTime (*)();

// What the network was shown for an answer, and what it said. Valid until the next answer.
struct Inference {
  std::span<const float> input, output;
  std::uint64_t number = 0;  // 1, 2, 3, ... in the life of the responder
  bool after_reset = false;  // the policy had forgotten its past before it
};

class Responder {
 public:
  // Precondition: check_policy_section and check_fit passed. `policy` outlives this.
  Responder(const config::RobotConfig& robot, std::uint64_t policy_hash, Policy& policy);

  // A new lease: sequences start at 1 again.
  void start_session();
  // `samples`: one per sensor of the robot file, judged usable. outside_sensed_at is the oldest among the newest
  // samples of the sensors in use; older samples kept as history do not count. The chunk is valid until the next call.
  const CommandChunk& answer(const Observation& observation, std::span<const SensorSample> samples,
                             MonoTime dequeued_at, Clock clock);

  // Of the newest answer; empty before the first.
  [[nodiscard]] const Inference& inference() const { return inference_; }

 private:
  void forget();

  Policy& policy_;
  ObservationBuilder input_;
  ChunkBuilder chunk_builder_;
  LastAction last_action_;
  std::vector<std::size_t> sensors_;
  std::vector<float> output_;
  CommandChunk chunk_;
  std::uint64_t sequence_ = 0;
  Continuity continuity_;
  Inference inference_;
  bool forgot_ = true;  // since the newest inference
};

}  // namespace takt::policy_host
