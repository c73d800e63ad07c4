// SPDX-License-Identifier: Apache-2.0
// What the monitor tells ROS 2, as values: made by Condenser, waiting in Outbox, written by Participant.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "executive/contract/session.hpp"
#include "executive/contract/tick_record.hpp"
#include "monitor/record/diagnostics.hpp"

namespace takt::monitor::dds {

// Joints in the robot file's order.
struct JointStates {
  std::int64_t unix_ns = 0;        // when the oldest of the positions was received
  std::vector<double> position{};  // rad, measured
  std::vector<double> velocity{};  // rad/s, estimated
  std::vector<double> effort{};    // Nm, measured
};

struct Diagnostics {
  std::int64_t unix_ns = 0;
  std::vector<Diagnostic> parts{};  // executive, joints, buses
};

struct Status : RobotStatus {
  std::int64_t unix_ns = 0;
  bool running = true;
};

struct CommandAge {
  std::int64_t unix_ns = 0;
  std::uint64_t tick = 0;
  std::uint64_t sequence = 0;
  std::uint64_t observation = 0;
  AgeParts age{};
};

// What a participant of the domain asks for.
struct Request {
  std::string robot{};
  std::string machine{};  // empty: any that runs a robot of this name
  std::uint64_t id = 0;
  std::string verb{};
  std::int64_t sent_unix_ns = 0;  // the sender's clock
};

struct RequestAnswer {
  std::uint64_t id = 0;
  std::string verb{};  // empty: no request yet
  bool done = false;
  std::string sentences{};
};

}  // namespace takt::monitor::dds
