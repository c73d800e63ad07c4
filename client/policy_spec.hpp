// SPDX-License-Identifier: Apache-2.0
// What a policy behind takt/client.h says of itself, and how it is told that a robot file says otherwise. Plain values.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <utility>
#include <vector>

#include "client/takt/client.h"
#include "config/robot_config.hpp"

namespace takt::client {

struct Term {
  std::uint32_t kind = TAKT_TERM_Q;
  std::uint32_t values = 0;  // streams, queues and images only, as all below
  std::string stream;
  std::string unit, max_age;  // empty: not compared
};

struct PolicySpec {
  std::vector<Term> terms;
  std::string robot_file, runtime_directory, program, step;
  std::uint32_t steps = 0;
  std::string candidate_file;  // empty: the robot's own policy
  std::string join;            // empty: not compared
};

// Has one of the return codes that are an exit code as well.
struct Refusal {
  int code;
  std::string sentence;
};
inline std::unexpected<Refusal> refuse(std::string sentence) {
  return std::unexpected(Refusal{TAKT_BAD_CONFIG, std::move(sentence)});
}

// Precondition: robot.policy.
std::expected<void, Refusal> check_spec(const config::RobotConfig& robot, const PolicySpec& spec);

}  // namespace takt::client
