// SPDX-License-Identifier: Apache-2.0
// One observation in, one command chunk out: input vector, inference, joint targets, what the answers before leave of
// them (chunk_mixer.hpp), stamps. Everything a policy host
// does between reading and publishing, without the reading and publishing.
//
// Forgets the past (histories, last action, hidden state) where an observation does not go on from the last
// (continuity.hpp), and after an output that is not finite. Time comes from the clock passed in. Thread rule: one
// thread, but for infer(); no allocation once a request is warm.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "policy_host/chunk_builder.hpp"
#include "policy_host/chunk_mixer.hpp"
#include "policy_host/continuity.hpp"
#include "policy_host/flow/flow_context.hpp"
#include "policy_host/observation_builder.hpp"
#include "policy_host/policy.hpp"

namespace takt::policy_host {

using Clock = MonoTime (*)();

// What the network was shown for an answer, and what it said. Valid until the next answer.
struct Inference {
  std::span<const float> input, output;
  std::span<const SeenImage> images;  // one per image place of the input
  std::uint64_t number = 0;           // 1, 2, 3, ... in the life of the responder
  bool after_reset = false;           // the policy had forgotten its past before it
};

// An observation on its way to becoming an answer. One is in the hands of one thread at a time.
struct Request {
  Observation observation;
  std::vector<float> input, output;
  std::vector<SeenImage> images;  // in the input
  MonoTime dequeued_at, outside_sensed_at, infer_started_at, infer_ended_at;
  std::uint64_t session = 0, sequence = 0, dropped = 0, times_forgotten = 0;
  bool after_reset = false;
};

class Responder {
 public:
  // Precondition: check_policy_section and check_fit passed. `policy` outlives this. `owner`: whether observations
  // speak of its answers when they say what is being played.
  Responder(const config::RobotConfig& robot, std::uint64_t policy_hash, Policy& policy,
            PathOwner owner = PathOwner::policy);

  // A new lease: sequences start at 1 again.
  void start_session();
  // `samples`: one per sensor of the robot file, judged usable. outside_sensed_at is the oldest among the newest
  // samples of the sensors in use; older samples kept as history do not count. The chunk is valid until the next call.
  // `images`: as ObservationBuilder::build takes them.
  const CommandChunk& answer(const Observation& observation, std::span<const SensorSample> samples,
                             MonoTime dequeued_at, Clock clock, Images images = {});

  // A sampler that draws on the path being played, to continue what is promised of it or to choose the nearest to it:
  // the newest answer is not being played yet, and will change that path. The observation is not to be asked of.
  [[nodiscard]] bool awaits(const Observation& observation) const;

  // The same in three steps, for several requests in flight: ask() of each observation in order, infer() anywhere,
  // take() in the order in which they end. take(): null for one that an answer to a newer observation has overtaken,
  // for one of an earlier session, and for one that continues a promised prefix which ended before it did. Two of those
  // in a row are let through: the executive learns from the second how late answers are now. The chunk is valid until
  // the next, inference() until the request is used again.
  void ask(const Observation& observation, std::span<const SensorSample> samples, MonoTime dequeued_at,
           Request& request, Images images = {});
  static void infer(Policy& policy, Request& request, Clock clock);
  const CommandChunk* take(const Request& request, Clock clock);

  // Of the newest answer; empty before the first.
  [[nodiscard]] const Inference& inference() const { return inference_; }

 private:
  void forget();
  [[nodiscard]] bool continues_in_time(const Request& request);

  Policy& policy_;
  ObservationBuilder input_;
  ChunkBuilder chunk_builder_;
  ChunkMixer mixer_;
  LastAction last_action_;
  std::optional<FlowMemory> flow_;  // of a sampler
  config::PrefixUse prefix_ = config::PrefixUse::none;
  bool draws_on_path_ = false;
  Duration step_period_;
  std::size_t steps_;
  bool dropped_late_ = false;  // the answer before
  std::vector<std::size_t> sensors_;
  std::size_t output_size_;
  CommandChunk chunk_;
  Request only_;  // answer()'s
  std::uint64_t session_ = 0;
  std::uint64_t sequence_ = 0;        // of the newest observation asked of
  std::uint64_t taken_sequence_ = 0;  // of the newest answer
  std::uint64_t times_forgotten_ = 0;
  Continuity continuity_;
  Inference inference_;
  bool forgot_ = true;  // since the newest was asked
};

}  // namespace takt::policy_host
