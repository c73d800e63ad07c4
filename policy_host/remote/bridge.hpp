// SPDX-License-Identifier: Apache-2.0
// On the robot: takes the policy's lease at the executive, shows observations and samples of outside sensors to policy
// servers in the robot file's DDS domain, and plays the answers of one of them. To the executive it is a policy host
// like any other, trusted with nothing.
//
// Age is the executive's: every answer names an observation of this session, and what the oldest sample shown with it
// was, the bridge knows by itself. No clock of another machine counts.
// Thread rule: one thread, SCHED_OTHER. Errors: one sentence, from open().
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <expected>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "dds/domain.hpp"
#include "policy_host/executive_link.hpp"
#include "policy_host/notice.hpp"
#include "policy_host/remote/answer_gate.hpp"
#include "policy_host/remote/server_choice.hpp"
#include "policy_host/remote/silence.hpp"
#include "policy_host/remote/topics.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::policy_host::remote {

class Bridge {
 public:
  // Precondition: check_policy_section passed, robot.dds. `robot` outlives this.
  static std::expected<std::unique_ptr<Bridge>, std::string> open(const config::RobotConfig& robot,
                                                                  const std::string& runtime_directory,
                                                                  std::uint64_t policy_hash);
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;
  ~Bridge() = default;
  // Returns soon after `stop` turns true.
  void run(const std::atomic<bool>& stop);

 private:
  struct Source {
    std::size_t sensor;  // index into the robot's sensors
    SensorLink link;
    std::vector<std::byte> payload;   // an image's header and bytes; empty: floats
    std::uint64_t sequence = 0;       // of the last Sample sent in this epoch
    std::uint64_t sent_sequence = 0;  // the sensor's own
    MonoTime sent_sensed_at;
  };
  Bridge(const config::RobotConfig& robot, const std::string& runtime_directory, std::uint64_t policy_hash,
         dds::Domain domain);
  std::expected<void, std::string> open_endpoints();
  void attach(MonoTime now);
  void look(MonoTime now);
  void update(Source& source, MonoTime now);
  void show(const Observation& observation, MonoTime dequeued_at);
  bool send_sample(Source& source);
  void send(const Observation& observation, const Shown& shown);
  void take_answers();
  void take(const takt_remote_Command& message, const PeerId& sender);
  void take(const takt_remote_ServerStatus& message, const PeerId& sender);
  void state_problem(MonoTime now);
  void report(MonoTime now);

  const config::RobotConfig& robot_;
  std::string socket_;
  Hello hello_;
  dds::Domain domain_;
  dds_entity_t observations_ = 0, samples_writer_ = 0, commands_ = 0, status_ = 0, wait_set_ = 0;
  std::vector<std::size_t> in_use_;
  std::vector<Source> sources_;               // one per sensor in use
  std::vector<SensorSample> samples_, used_;  // one per sensor of the robot file: newest, and what is shown
  std::optional<ExecutiveLink> executive_;
  AnswerGate gate_;
  ServerChoice choice_;
  Silence silence_;
  MachineProbe probe_;  // of the leader's machine
  MonoTime next_attempt_, observed_, reported_;
  MonoTime played_at_;  // the newest answer, or the beginning of the session
  std::string lacks_;   // the sensor without which no observation is passed on; empty: none
  struct StatedSource {
    PeerId server;
    std::string said;
  };
  StatedSource source_of_session_;  // who was stated to make the commands; unknown: not yet
  bool looked_since_due_ = false;
  CommandChunk chunk_;
  std::uint64_t shown_ = 0, played_ = 0;
  std::array<std::uint64_t, kAnswerVerdictCount> verdicts_{};
  Duration longest_answer_;
  std::string leader_name_;
  Notice no_executive_, no_sensor_;
};

}  // namespace takt::policy_host::remote
