// SPDX-License-Identifier: Apache-2.0
// A policy in a process of its own, behind takt/client.h: the robot file against what the policy says it is, the lease,
// the newest observation as the terms that were asked for, stamps, and the chunk on its way out.
//
// Errors: an outcome and one sentence. Thread rule: one thread; nothing blocks but attach() and next(), as long as they
// are told to, a sensor's connect deadline apart (policy_host/sensor_link.hpp). After open() nothing allocates but an
// attach.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/alternatives.hpp"
#include "client/policy_spec.hpp"
#include "client/promised_path.hpp"
#include "client/sample_queue.hpp"
#include "client/shown_evidence.hpp"
#include "client/takt/client.h"
#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "executive/contract/session.hpp"
#include "policy_host/chunk_mixer.hpp"
#include "policy_host/continuity.hpp"
#include "policy_host/executive_link.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::client {

class PolicySession {
 public:
  static std::expected<std::unique_ptr<PolicySession>, Refusal> open(const PolicySpec& spec);
  PolicySession(const PolicySession&) = delete;
  PolicySession& operator=(const PolicySession&) = delete;
  ~PolicySession() = default;

  // These return the codes of takt/client.h.
  int attach(Duration timeout);
  int next(Duration timeout);
  int infer_begin();
  int infer_end();
  int publish(const takt_chunk& chunk);
  // As takt_policy_state_problem and takt_policy_state_source.
  int state_problem(std::string problem);
  int state_source(std::string source);
  void detach() { executive_.reset(); }

  [[nodiscard]] const takt_robot& robot() const { return robot_view_; }
  [[nodiscard]] const takt_observation& observation() const { return view_; }
  [[nodiscard]] const takt_alternatives& alternatives() const { return alternatives_.counts(); }
  [[nodiscard]] const takt_stream* stream(const char* name) const;
  [[nodiscard]] const std::string& sentence() const { return sentence_; }

 private:
  struct Block {
    std::uint32_t kind;
    std::size_t sensor;  // index into the robot's sensors; streams, queues and images only
    std::size_t values;
  };
  PolicySession(config::RobotConfig robot, const PolicySpec& spec, std::uint64_t policy_hash,
                const std::string& runtime_directory);
  void add_evidence();  // once the terms and queues are there
  int try_to_attach(MonoTime now);
  int look(MonoTime now);
  [[nodiscard]] MonoTime next_look() const;
  // In lockstep: the instant of `newest`, by which its samples are judged.
  [[nodiscard]] MonoTime instant_of(const Observation& newest) const;
  // In lockstep: says that the observation has no answer, where nothing else was said.
  void pass(std::uint64_t observation_id);
  void update_sensor(std::size_t used, MonoTime now);
  [[nodiscard]] bool has_usable_samples(const Observation& newest, MonoTime now);
  void show(MonoTime now);
  void show_promise();
  [[nodiscard]] const float* values_of(const Block& block) const;
  void fill_values();
  bool fill_chunk(const takt_chunk& given);  // false: it is too large
  void send(MonoTime outside_sensed_at, MonoTime infer_started_at, MonoTime infer_ended_at);
  void send_alternative();  // in place of an answer to the observation that is shown, until there is one
  [[nodiscard]] MonoTime oldest_sensed_at() const;  // of what the observation shown rests on
  int misused(const char* sentence);

  config::RobotConfig robot_;
  std::string socket_;
  Hello hello_;
  std::vector<Block> blocks_;
  std::vector<std::size_t> sensors_in_use_;
  std::vector<policy_host::SensorLink> sensors_;  // one per sensor in use
  std::vector<SensorSample> samples_, used_;      // one per sensor of the robot file: newest, and what is shown
  std::vector<std::vector<std::byte>> payloads_;  // per sensor in use: an image's header and bytes; else empty
  std::vector<const std::uint8_t*> images_;       // into those, in the terms' order
  std::vector<SampleQueue> queues_;               // in the terms' order
  std::vector<std::size_t> queued_;               // per sensor in use: index of its queue; the largest number: none
  std::vector<takt_queue> queue_views_;           // into those
  std::vector<takt_stream> streams_;              // one per sensor of the robot file
  std::size_t largest_input_;                     // bytes; 0: what the policy is shown is not recorded
  std::optional<ShownEvidence> evidence_;         // where it is
  PromisedPath promised_;
  Alternatives alternatives_;
  policy_host::ChunkMixer mixer_;
  std::optional<policy_host::ExecutiveLink> executive_;
  MonoTime next_attempt_;
  MonoTime seen_published_at_;  // of the newest observation read; unset: none in this session
  bool looked_since_due_ = false;
  policy_host::Continuity continuity_;
  bool forget_ = true;
  Observation observation_;
  CommandChunk chunk_;
  MonoTime dequeued_at_, infer_started_at_, infer_ended_at_;  // of the observation returned last
  std::uint64_t sequence_ = 0;
  std::uint64_t answered_id_ = 0;  // newest observation that something was said to
  std::string sentence_;
  std::string problem_;                 // why the policy publishes nothing, as it says
  std::string source_, stated_source_;  // who makes its commands; as the executive of this session was told
  std::vector<float> values_;
  std::vector<const char*> joint_names_;
  std::vector<float> home_;
  takt_robot robot_view_{};
  takt_observation view_{};
};

}  // namespace takt::client
