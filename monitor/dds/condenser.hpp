// SPDX-License-Identifier: Apache-2.0
// Boils a run's ticks down to what ROS 2 is told: joint states at the configured rate, the age of every command at its
// first use, status ten times a second, diagnostics once a second, and the last two at once when the mode changes.
//
// No clock and no I/O: time is the ticks' own. Stamps are Unix time by one offset for the whole session. Joint states
// begin when every joint has been heard, and pause while no joint says anything new. Their stamp is that of the oldest
// position: it never goes back, and stands still while one joint is silent and others are not.
// Thread rule: one thread.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "config/robot_config.hpp"
#include "monitor/dds/messages.hpp"
#include "monitor/dds/outbox.hpp"

namespace takt::monitor::dds {

inline constexpr Duration kStatusPeriod = milliseconds(100);

class Condenser {
 public:
  // Ticks before `since` are history, such as the rings hold it when the monitor attaches: they are not told.
  // Precondition: robot.dds. `robot` and `out` outlive the condenser.
  Condenser(const config::RobotConfig& robot, std::int64_t monotonic_to_unix_ns, MonoTime since, Outbox& out);
  void tick(const TickRecord& record);
  // The executive ended: says so with its last status.
  void end();

 private:
  void put_joint_states(const TickRecord& record);
  [[nodiscard]] Status status(bool running) const;
  [[nodiscard]] std::int64_t unix_ns(MonoTime at) const { return at.ns + monotonic_to_unix_ns_; }

  const config::RobotConfig& robot_;
  Outbox& out_;
  std::int64_t monotonic_to_unix_ns_;
  MonoTime since_;
  Diagnoser diagnoser_;
  RateLimit joint_state_rate_, status_rate_{kStatusPeriod};
  MonoTime newest_heard_;  // of any joint, in the last joint states
};

}  // namespace takt::monitor::dds
