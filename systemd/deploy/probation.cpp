// SPDX-License-Identifier: Apache-2.0
#include "systemd/deploy/probation.hpp"

#include <fmt/format.h>

#include <utility>

namespace takt::deploy {

Stage Probation::end(Stage stage, std::string reason) {
  reason_ = std::move(reason);
  return stage;
}

Stage Probation::look(Duration now, const std::optional<StatusSnapshot>& status) {
  if (is_over(stage_)) return stage_;
  const Stage before = stage_;
  if (stage_ == Stage::starting) {
    stage_ = start(now, status);
  } else if (!status) {
    stage_ = end(Stage::failed, "the executive no longer answers");
  } else if (status->ticks < ticks_) {
    stage_ = end(Stage::failed, "the executive restarted");
  } else if (status->monitor_pid == 0) {
    stage_ = end(Stage::failed, "the monitor has left: nothing is recorded (journalctl -u takt-monitor)");
  } else if (wanted_.fallback && status->policy_pids[Seat::fallback] == 0) {
    stage_ = end(
        Stage::failed,
        "the fallback policy's host has left: no policy would take over (journalctl -u takt-policy-host-fallback@*)");
  } else {
    stage_ = stage_ == Stage::waiting ? wait(now, *status) : prove(now, *status);
  }
  if (status) ticks_ = status->ticks;
  if (stage_ != before) since_ = now;
  return stage_;
}

Stage Probation::start(Duration now, const std::optional<StatusSnapshot>& status) {
  std::string missing;
  if (!status)
    missing = fmt::format("no executive answers in {}; --runtime-dir names another directory", runtime_directory_);
  else if (wanted_.policy && status->policy_pids[Seat::policy] == 0)
    missing = "no policy is attached to the executive";
  else if (wanted_.fallback && status->policy_pids[Seat::fallback] == 0)
    missing = "no fallback policy is attached to the executive";
  else if (status->monitor_pid == 0)
    missing = "no monitor is attached to the executive";
  else
    return Stage::waiting;
  if (now < times_.start_within) return Stage::starting;
  return end(Stage::failed, fmt::format("after {:.0f} s {}", times_.start_within.seconds(), missing));
}

Stage Probation::wait(Duration now, const StatusSnapshot& status) {
  switch (status.tick.mode) {
    case Mode::tracking:
      return Stage::proving;
    case Mode::arming:
      return Stage::waiting;
    case Mode::fault_latched:
    case Mode::degraded:
    case Mode::damped_stop:
      return end(Stage::failed, fmt::format("it went to {} before it tracked", name(status.tick.mode)));
    case Mode::standby:
      break;
  }
  if (now - since_ < times_.arm_within) return Stage::waiting;
  return end(Stage::unproven, fmt::format("it was not armed within {:.0f} s", times_.arm_within.seconds()));
}

Stage Probation::prove(Duration now, const StatusSnapshot& status) {
  const double tracked = (now - since_).seconds();
  switch (status.tick.mode) {
    case Mode::tracking:
      break;
    case Mode::degraded:
      return end(Stage::failed, fmt::format("the robot was degraded after {:.1f} s of tracking", tracked));
    case Mode::fault_latched:
      return end(Stage::failed, fmt::format("a fault was latched after {:.1f} s of tracking", tracked));
    case Mode::damped_stop:
    case Mode::standby:
    case Mode::arming:
      return end(Stage::failed, fmt::format("it was stopped after {:.1f} s of tracking", tracked));
  }
  if (now - since_ < times_.watch) return Stage::proving;
  return end(Stage::passed, fmt::format("tracked for {:.0f} s within its contract", times_.watch.seconds()));
}

}  // namespace takt::deploy
