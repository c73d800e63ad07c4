// SPDX-License-Identifier: Apache-2.0
// The policy host in virtual time: the real observation builder, network and chunk builder (policy_host/responder), or
// the real program that is the policy (policy_process.hpp), and a model of when things happen around them.
//
//   observation published -> readable kPublishMargin later (plus up to 0.1 ms) -> host free -> inference (lognormal) ->
//   publication -> the first tick afterwards finds the command in the mailbox
//
// With policy.requests_in_flight above 1 there are as many inferences at a time, paced as the host paces them; an
// answer that comes after one to a newer observation is dropped there.
//
// A sampler that continues the path being played takes up no observation before its answer is played
// (responder.awaits).
//
// A policy may draw from several modes (PolicyTiming), as one that samples does: every answer belongs to one of them,
// and two answers may contradict each other about the same instants.
//
// Mailboxes hold the newest value only, in both directions; queue_growth turns the observations' into a queue. What an
// inference takes is drawn from the seed and the observation's id, so that rollouts of several methods share it.
// One policy process stands behind it, which may crash and be replaced (another session) or stand still.
// Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "config/robot_config.hpp"
#include "evidence/rollout/perturbation.hpp"
#include "evidence/rollout/policy_process.hpp"
#include "evidence/rollout/random.hpp"
#include "evidence/rollout/sensor_feed.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"
#include "policy_host/pacing.hpp"
#include "policy_host/policy.hpp"
#include "policy_host/responder.hpp"

namespace takt::evidence {

// `modes` above 1: an answer's outputs drift from what the network says by up to `mode_spread`, further the later in
// the chunk, half of it half way. The modes lie evenly between all that far up and all that far down; which one an
// answer has is drawn anew each time.
struct PolicyTiming {
  Duration inference = milliseconds(8);  // mean
  double spread = 0.25;                  // standard deviation of the duration's logarithm
  Duration publish = microseconds(60);   // inference ended -> command in the mailbox
  std::uint32_t modes = 1;
  double mode_spread = 0;  // in units of the network's outputs, at the chunk's end
};

// The newest sample of a sensor, when the policy was asked.
struct ShownSample {
  std::size_t sensor = 0;  // of the robot file
  const SensorSample& sample;
  std::span<const std::uint8_t> pixels;  // empty: values
};

struct ArrivedCommand {
  MonoTime sensed_at;     // oldest joint sample of the observation it answers
  MonoTime observed_at;   // publication of that observation
  MonoTime published_at;  // by the host
  MonoTime arrives_at;
  std::unique_ptr<CommandChunk> chunk;
};

// Who answers: a network, or a program. One of the two.
struct Answering {
  Answering(policy_host::Policy& given) : network(&given) {}
  Answering(PolicyProcess& given) : program(&given) {}  // begun, when a rollout begins

  policy_host::Policy* network = nullptr;
  PolicyProcess* program = nullptr;
};

class VirtualPolicy {
 public:
  // Preconditions as the responder's. Everything referred to outlives this.
  VirtualPolicy(const config::RobotConfig& robot, std::uint64_t policy_hash, const Answering& answering,
                const PolicyTiming& timing, const Disturbance& disturbance, const Disturbance& of_sensors,
                std::uint64_t seed);

  void observe(const Observation& observation);
  // What a sensor has published: the robot file's `sensor`-th.
  void sense(std::size_t sensor, const simulation::Sensed& sensed) { feeds_[sensor].take(sensed); }
  // Called for each sample that the policy is shown.
  void on_shown(std::function<void(const ShownSample&)> told) { told_ = std::move(told); }
  // Does everything that the host does up to `now`.
  void run_until(MonoTime now);
  // What arrived in the mailbox since the last call, the newest only; null: nothing. Valid until the next call.
  const ArrivedCommand* read(MonoTime now);
  [[nodiscard]] std::uint8_t session() const { return session_; }

 private:
  struct Waiting {
    Observation observation;
    MonoTime readable_at;
    Duration callbacks;  // other work queued up before it
  };
  void live_through_crash(MonoTime now);
  [[nodiscard]] MonoTime awake(MonoTime at) const;
  [[nodiscard]] MonoTime end_of(MonoTime start, Duration work) const;
  Waiting next(MonoTime ready);
  // When the next observation is taken up, and when the next inference has been published; unset: neither is to come.
  [[nodiscard]] MonoTime next_request() const;
  [[nodiscard]] MonoTime next_publication() const;
  void ask(const Waiting& waiting, MonoTime dequeued_at);
  [[nodiscard]] Duration inference_time(Random& draw, MonoTime started);
  void publish_next();
  [[nodiscard]] std::unique_ptr<CommandChunk> copy_of(const CommandChunk& chunk);
  struct InFlight {
    policy_host::Request request;  // of a program: its observation and stamps alone
    MonoTime published;
    Random draw;
    std::unique_ptr<CommandChunk> said;  // by a program; null: nothing
  };
  void ask_network(InFlight& one, MonoTime dequeued_at, MonoTime started, MonoTime ended);
  void ask_program(InFlight& one, MonoTime dequeued_at, MonoTime started, MonoTime ended);
  const CommandChunk* taken(InFlight& one);
  void spoil(CommandChunk& chunk, Random& draw, MonoTime at) const;
  void drift(policy_host::Request& request) const;
  [[nodiscard]] bool is_dead(MonoTime at) const;

  const config::RobotConfig& robot_;
  const PolicyTiming timing_;
  const Disturbance& disturbance_;
  std::uint64_t seed_;
  Answering answering_;
  std::function<void(const ShownSample&)> told_;
  std::optional<policy_host::Responder> responder_;  // of a network
  policy_host::RequestPacing pacing_;
  std::vector<SensorFeed> feeds_;  // one per sensor of the robot file
  std::vector<std::size_t> sensors_in_use_;
  std::vector<SensorSample> samples_, used_;           // newest, and what the policy is shown
  std::vector<std::span<const std::uint8_t>> images_;  // of those samples, in the feeds; empty: of numbers
  std::deque<Waiting> waiting_;
  std::deque<ArrivedCommand> sent_;
  ArrivedCommand newest_;
  std::unique_ptr<CommandChunk> spare_;  // a command's that was read; null: none
  std::vector<MonoTime> free_at_;        // one per request in flight
  std::vector<InFlight> in_flight_;
  std::int64_t stalls_ = 0, bursts_ = 0;  // turns of the perturbation that are done
  MonoTime program_published_;            // its newest answer
  std::uint8_t session_ = 1;
  bool crashed_ = false, restarted_ = false;
};

}  // namespace takt::evidence
