// SPDX-License-Identifier: Apache-2.0
// The policy host's shell: attaches, waits for observations, answers them, publishes, says how it goes.
//
// The executive and the sensors may start, stop and restart at any time and in any order; the host attaches again with
// a fresh session. Without a usable sample of every sensor in use it publishes nothing: the executive's freshness
// contract deals with the silence. Asked for on its command line, it does some things wrong (host_faults.hpp).
// With several requests in flight each has a network and a thread of its own (inference_pool.hpp); all else stays in
// one. Thread rule: one thread, SCHED_OTHER.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/trace/trace.hpp"
#include "policy_host/executive_link.hpp"
#include "policy_host/host_faults.hpp"
#include "policy_host/host_statistics.hpp"
#include "policy_host/inference_pool.hpp"
#include "policy_host/input_evidence.hpp"
#include "policy_host/notice.hpp"
#include "policy_host/pacing.hpp"
#include "policy_host/policy.hpp"
#include "policy_host/responder.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::policy_host {

class Host {
 public:
  // Precondition: check_policy_section and check_fit passed. `robot` and `policies` outlive this; there are as many as
  // policy.requests_in_flight, all of one file. `role`: policy, or
  // fallback_policy, for which `robot` is what config::seen_by_fallback says.
  Host(const config::RobotConfig& robot, const std::string& runtime_directory, std::uint64_t policy_hash,
       std::span<Policy* const> policies, HostFaults faults = {{}, 0}, Role role = Role::policy);
  // Returns within half a second after `stop` turns true, or what an inference takes where that is longer.
  void run(const std::atomic<bool>& stop);

 private:
  void attach(MonoTime now);
  void look(MonoTime now);
  // The newest observation, or with a fault the next one of a queue.
  bool read(Observation& observation);
  bool read_from_queue(Observation& observation);
  void answer(const Observation& observation, MonoTime dequeued_at);
  void update_sensors(MonoTime now);
  [[nodiscard]] MonoTime next_request(MonoTime now) const;
  // Sleeps until the next look is due; false where it is not yet, because something else had to be done.
  bool wait(MonoTime now);
  void deliver(std::size_t asked);
  void publish(const CommandChunk& chunk);
  void publish_held(MonoTime now);
  void report(MonoTime now);

  const config::RobotConfig& robot_;
  std::string socket_;
  Hello hello_;
  trace::Introduction introduction_;
  Responder responder_;
  std::size_t largest_input_;              // bytes; 0: inputs are not recorded
  std::optional<InputEvidence> evidence_;  // where they are
  std::vector<std::size_t> sensors_in_use_;
  std::vector<SensorLink> sensors_;                    // one per sensor in use
  std::vector<SensorSample> samples_;                  // one per sensor of the robot file: newest
  std::vector<std::vector<std::byte>> image_buffers_;  // one per sensor in use, with its header; empty: no images
  std::vector<std::span<const std::uint8_t>> images_;  // into those, one per sensor of the robot file
  std::optional<ExecutiveLink> executive_;
  MonoTime observed_;              // published_at of the newest observation; unset: none in this session
  std::uint64_t observed_id_ = 0;  // its id
  bool looked_since_due_ = false;
  struct Asked {
    Request request;
    std::vector<SensorSample> used;  // as samples_: what the policy is shown
  };
  Policy& only_policy_;       // without a pool
  std::vector<Asked> asked_;  // one per request in flight
  RequestPacing pacing_;
  struct Held {
    MonoTime due;
    CommandChunk chunk;
  };
  HostFaults faults_;
  std::deque<Observation> queue_;  // queue_growth only
  std::deque<Held> held_;          // with faults only: on their way out
  HostStatistics statistics_;
  MonoTime reported_;
  Notice no_executive_, no_sensor_;
  std::optional<InferencePool> pool_;  // of several requests in flight; the first to go: its threads use the above
};

}  // namespace takt::policy_host
