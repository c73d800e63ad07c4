// SPDX-License-Identifier: Apache-2.0
// On the policy's machine: shows the observations of a robot's bridge to a policy that sits here as if at the
// executive, and sends its answers back. One per robot; a robot may have several, on several machines.
//
// It serves one bridge: the first that shows observations, until that is silent for freshness.max_age. What another
// shows meanwhile under the robot's name is counted and told: a namesake's, or a stranger's.
//
// Instants come as ages and get stamps of this machine's clock, so that neither machine has to know the other's. A new
// session of the bridge makes the policy forget (its observations' ids jump). Thread rule: one thread.
// Errors: one sentence, from open().
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <expected>
#include <memory>
#include <optional>
#include <string>

#include "config/robot_config.hpp"
#include "dds/domain.hpp"
#include "policy_host/notice.hpp"
#include "policy_host/policy_seat.hpp"
#include "policy_host/remote/far_samples.hpp"
#include "policy_host/remote/topics.hpp"

namespace takt::policy_host::remote {

struct ServerOptions {
  std::string runtime_directory, name;  // name: for people, at most 64 characters
  std::optional<uid_t> policy_user;
};

class Server {
 public:
  // Precondition: check_policy_section passed, robot.dds. `robot` outlives this.
  static std::expected<std::unique_ptr<Server>, std::string> open(const config::RobotConfig& robot,
                                                                  const ServerOptions& options,
                                                                  std::uint64_t policy_hash);
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  ~Server() = default;
  // Returns soon after `stop` turns true.
  void run(const std::atomic<bool>& stop);

 private:
  // What an observation shown here is on the robot.
  struct Arrived {
    std::uint64_t id = 0, epoch = 0, robot_id = 0;
    MonoTime at;
    MonoTime oldest_shown_at;  // when the oldest sample that came with it was sensed
  };
  struct Sent {
    std::uint64_t sequence = 0, session = 0, policy_sequence = 0;
  };
  Server(const config::RobotConfig& robot, std::string name, std::uint64_t policy_hash, dds::Domain domain,
         std::unique_ptr<PolicySeat> seat, FarSamples samples);
  std::expected<void, std::string> open_endpoints();
  void take_observation(const takt_remote_Observation& message, const PeerId& sender);
  [[nodiscard]] bool is_for_us(const takt_remote_Observation& message, MonoTime now);
  [[nodiscard]] bool is_of_our_bridge(const PeerId& sender, MonoTime now);
  std::uint64_t id_here(const takt_remote_Observation& message);
  void show(const takt_remote_Observation& message, MonoTime arrived_at);
  void answer();
  void tell_status(MonoTime now);
  void report(MonoTime now);

  const config::RobotConfig& robot_;
  std::string name_;
  std::uint64_t policy_hash_, number_;
  std::string address_;  // of this machine, for the bridge to ask whether it is there
  dds::Domain domain_;
  dds_entity_t observations_ = 0, samples_reader_ = 0, commands_ = 0, status_ = 0, wait_set_ = 0;
  std::unique_ptr<PolicySeat> seat_;
  FarSamples samples_;
  PeerId bridge_;  // whose observations are shown; unknown: none came yet
  MonoTime bridge_heard_;
  std::uint64_t epoch_ = 0, newest_robot_id_ = 0, newest_id_ = 0, sequence_ = 0;
  std::array<Arrived, 1024> arrived_{};
  std::array<Sent, 256> sent_{};
  CommandChunk chunk_;
  MonoTime unanswered_since_, reported_, shown_at_, incomplete_at_, other_files_at_, status_told_;
  bool told_of_policy_ = false;
  std::uint64_t shown_ = 0, incomplete_ = 0, answered_ = 0, of_others_ = 0;
  Notice other_robot_, other_bridge_;
};

}  // namespace takt::policy_host::remote
