// SPDX-License-Identifier: Apache-2.0
// The first seconds of a deployment on the robot, judged from what its executive says of itself. Pure: statuses and
// times come in, a verdict comes out.
//
//   starting   until the executive answers and policies and monitor are attached, or `start_within` is over: failed
//   waiting    in standby, until the operator arms it, or `arm_within` is over: unproven
//   proving    tracking; `watch` of it: passed. Degraded, a stop or a fault: failed. Who stopped it is not asked: an
//              operator who stops a robot in its first seconds does not trust it.
// An executive that goes away or begins to count its ticks anew has failed; so has a robot without its monitor: nothing
// records it; and one without its fallback policy's host: no policy would take over.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "executive/contract/session.hpp"

namespace takt::deploy {

struct ProbationTimes {
  Duration start_within = seconds(20);
  Duration arm_within = seconds(120);
  Duration watch = seconds(30);
};

enum class Stage : std::uint8_t { starting, waiting, proving, passed, unproven, failed };

constexpr bool is_over(Stage stage) {
  switch (stage) {
    case Stage::starting:
    case Stage::waiting:
    case Stage::proving:
      return false;
    case Stage::passed:
    case Stage::unproven:
    case Stage::failed:
      return true;
  }
  return true;
}

// Which hosts the robot file asks for.
struct WantedHosts {
  bool policy = true, fallback = false;
};

class Probation {
 public:
  // `runtime_directory`: where its executive is asked, for the reason.
  Probation(const ProbationTimes& times, WantedHosts wanted, std::string runtime_directory)
      : times_(times), wanted_(wanted), runtime_directory_(std::move(runtime_directory)) {}
  // `now`: since the robot was started; `status`: absent when no executive answered.
  Stage look(Duration now, const std::optional<StatusSnapshot>& status);
  // Why it is over; empty before.
  [[nodiscard]] const std::string& reason() const { return reason_; }

 private:
  Stage start(Duration now, const std::optional<StatusSnapshot>& status);
  Stage wait(Duration now, const StatusSnapshot& status);
  Stage prove(Duration now, const StatusSnapshot& status);
  Stage end(Stage stage, std::string reason);

  ProbationTimes times_;
  WantedHosts wanted_;
  std::string runtime_directory_;
  Stage stage_ = Stage::starting;
  Duration since_;  // of this stage
  std::uint64_t ticks_ = 0;
  std::string reason_;
};

}  // namespace takt::deploy
