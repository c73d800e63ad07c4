// SPDX-License-Identifier: Apache-2.0
// What each joint is given in every mode, and what every request does there: read off the tick itself, which is run in
// virtual time (tests/executive/pipeline/rig.hpp) into each situation. Nothing here says what the answer is to be.
#pragma once

#include <array>
#include <expected>
#include <string>
#include <string_view>
#include <vector>

#include "executive/contract/mode.hpp"

namespace takt::docs {

// One joint in one situation, in words: what its setpoint is made of.
struct Given {
  std::string reference, gains, torque;
  bool operator==(const Given&) const = default;
};

struct Situation {
  std::string_view mode, when;
  Given given;
};
// The error names the situation that was not reached, or whose setpoint has no word here.
std::expected<std::vector<Situation>, std::string> measure_situations();

struct RequestRow {
  std::string_view request;
  std::array<std::string, kModeCount> leads_to;  // from each mode, in the order of Mode; "" where it changes nothing
};
std::expected<std::vector<RequestRow>, std::string> measure_requests();

// A silence of the policy of config/arm6.yaml in the repository: age of its last command, and what happens then.
struct Instant {
  double age_ms = 0;
  std::string_view what;
};
std::expected<std::vector<Instant>, std::string> measure_silence();

// What a limit of the robot file leads to when it is exceeded while the robot tracks.
struct Exceeded {
  std::string_view key, how;
  std::string cause, mode;
  bool keeps_power = false;  // every drive
  std::string_view proof;
};
std::expected<std::vector<Exceeded>, std::string> measure_limits();

}  // namespace takt::docs
