// What the monitor tells ROS 2, as values: made by Condenser, waiting in Outbox, written by Participant.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "executive/contract/session.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::monitor::dds {

// Joints in the robot file's order.
struct JointStates {
  std::int64_t unix_ns = 0;        // when the oldest of the positions was received
  std::vector<double> position{};  // rad, measured
  std::vector<double> velocity{};  // rad/s, estimated
  std::vector<double> effort{};    // Nm, measured
};

// Values of diagnostic_msgs/msg/DiagnosticStatus.
enum class Level : std::uint8_t { ok, warn, error, stale };

struct Diagnostic {
  Level level = Level::ok;
  std::string name{};     // "arm6: joint elbow"
  std::string message{};  // one line
  std::vector<std::pair<std::string, std::string>> values{};
};

struct Diagnostics {
  std::int64_t unix_ns = 0;
  std::vector<Diagnostic> parts{};  // executive, joints, buses
};

struct Status {
  std::int64_t unix_ns = 0;
  bool running = true;
  TickRecordHeader tick{};
  Cause cause = Cause::none;   // of the last change of mode
  std::string detail{};        // of that cause
  std::uint64_t overruns = 0;  // since the monitor attached
};

struct CommandAge {
  std::int64_t unix_ns = 0;
  std::uint64_t tick = 0;
  std::uint64_t sequence = 0;
  std::uint64_t observation = 0;
  AgeParts age{};
};

// What somebody in the domain asks for.
struct Request {
  std::string robot{};
  std::uint64_t id = 0;
  std::string verb{};
  std::int64_t sent_unix_ns = 0;  // the sender's clock
};

struct RequestAnswer {
  std::uint64_t id = 0;
  std::string verb{};  // empty: nobody asked yet
  bool done = false;
  std::string sentences{};
};

}  // namespace takt::monitor::dds
