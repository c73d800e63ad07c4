// SPDX-License-Identifier: Apache-2.0
// The monitor in a DDS domain: one participant, a writer per topic, and a reader for requests where they are allowed.
// Everything Cyclone DDS is behind this header. ROS 2's names and type hashes, its default QoS except where said.
//
//   rt/joint_states      sensor_msgs/msg/JointState            reliable, last 10
//   rt/diagnostics       diagnostic_msgs/msg/DiagnosticArray   reliable, last 10
//   rt/takt/status       takt_msgs/msg/Status                  reliable, last 1, transient local: late readers get it
//   rt/takt/command_age  takt_msgs/msg/CommandAge              reliable, last 256
//   rt/takt/request      takt_msgs/msg/Request                 reader; reliable, last 16, volatile: no old requests
//   rt/takt/status       likewise a reader, of others' robots: has one this name? last 256
//
// Thread rules: write() one thread, take_requests() one other; a write may block for kMaxBlocking, sometimes longer.
#pragma once

#include <chrono>
#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "monitor/dds/messages.hpp"
#include "monitor/dds/outbox.hpp"
#include "monitor/dds/requests.hpp"

namespace takt::monitor::dds {

inline constexpr std::chrono::milliseconds kMaxBlocking{100};

class Participant {
 public:
  // Precondition: robot.dds. `robot` outlives the participant. At most one per process and domain. The error is one
  // sentence.
  static std::expected<std::unique_ptr<Participant>, std::string> open(const config::RobotConfig& robot,
                                                                       const std::string& machine);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  // False: it was not written.
  bool write(const JointStates& message);
  bool write(const Diagnostics& message);
  bool write(const Status& message, const Losses& losses, const RequestAnswer& answer);
  bool write(const CommandAge& message);

  // Requests to this robot in the order they came, waiting at most `patience` for one; none where they are not allowed.
  std::vector<Request> take_requests(std::chrono::milliseconds patience);
  // Which robots of this name are in the domain now.
  const Address& address();

 private:
  class Entities;
  Participant(const config::RobotConfig& robot, const std::string& machine);
  const config::RobotConfig& robot_;
  std::string machine_;
  std::unique_ptr<Entities> entities_;
};

}  // namespace takt::monitor::dds
