// SPDX-License-Identifier: Apache-2.0
// Ticks as ROS 2's diagnostics: one part for the executive, one for each joint's drive, one for each bus. What runs
// hold (run_messages.hpp) and what DDS tells are made here. Pure: time is the ticks' own. Thread rule: one thread at a
// time.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/incident/incident.hpp"
#include "monitor/record/rate_limit.hpp"

namespace takt::monitor {

// Values of diagnostic_msgs/msg/DiagnosticStatus.
enum class Level : std::uint8_t { ok, warn, error, stale };
Level level_of(Mode mode);

struct Diagnostic {
  Level level = Level::ok;
  std::string name{};     // "arm6: joint elbow"
  std::string message{};  // one line
  std::vector<std::pair<std::string, std::string>> values{};
};

// Where a robot stands: its newest tick, and what only the ticks before it know.
struct RobotStatus {
  TickRecordHeader tick{};
  Cause cause = Cause::none;   // of the last change of mode
  std::string detail{};        // of that cause
  std::string incident{};      // the sentence of the stop or fault that the robot stands in; empty: it stands in none
  std::uint64_t overruns = 0;  // of the ticks seen
};

// `status` as of the same tick.
std::vector<Diagnostic> diagnose(const TickRecord& record, const RobotStatus& status, const config::RobotConfig& robot);
// No executive answers: one part, stale.
std::vector<Diagnostic> diagnose_absence(const config::RobotConfig& robot);

// Follows a robot tick by tick.
class Diagnoser {
 public:
  static constexpr Duration kPeriod = seconds(1);

  // `robot` outlives this.
  explicit Diagnoser(const config::RobotConfig& robot) : robot_(robot), incidents_(robot) {}
  // Diagnostics once a period, and at once when the mode changes.
  std::optional<std::vector<Diagnostic>> tick(const TickRecord& record);
  [[nodiscard]] const RobotStatus& status() const { return status_; }

 private:
  const config::RobotConfig& robot_;
  incident::IncidentWatch incidents_;
  RobotStatus status_;
  RateLimit rate_{kPeriod};
};

}  // namespace takt::monitor
