// SPDX-License-Identifier: Apache-2.0
#include "cli/run/checked_robot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "config/policy_signature.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::cli {

std::expected<CheckedRobot, std::string> check_robot_file(const std::string& path) {
  auto robot = config::load(path);
  if (!robot) return std::unexpected(robot.error());
  std::string problems;
  if (robot->policy)
    if (const auto hash = config::accepted_policy_sha256(*robot->policy); !hash)
      problems = fmt::format("{}: {}", path, hash.error());
  if (const config::Fallback* const fallback = config::fallback_policy_of(*robot);
      fallback != nullptr && fallback->has_own_file())
    if (const auto hash = config::accepted_policy_sha256(*config::seen_by_fallback(*robot, *fallback).policy); !hash)
      problems += fmt::format("{}{}: {}", problems.empty() ? "" : "\n", path, hash.error());
  // What a driver refuses, the executive would refuse at its start.
  for (std::size_t joint = 0; joint < robot->joints.size(); ++joint)
    if (const auto driver = drivers::make_joint_driver(*robot, joint); !driver)
      problems += fmt::format("{}{}: {}", problems.empty() ? "" : "\n", path, driver.error());
  auto loads = drivers::check_bus_load(*robot);
  if (!loads) problems += (problems.empty() ? "" : "\n") + loads.error();
  if (!problems.empty()) return std::unexpected(problems);
  return CheckedRobot{std::move(*robot), std::move(*loads)};
}

std::string first_problems(const std::string& problems) {
  constexpr std::size_t kMostTold = 10;
  std::size_t end = 0;
  for (std::size_t line = 0; line < kMostTold; ++line) {
    end = problems.find('\n', line == 0 ? 0 : end + 1);
    if (end == std::string::npos) return problems;
  }
  const auto more = std::count(problems.begin() + static_cast<std::ptrdiff_t>(end), problems.end(), '\n');
  return fmt::format("{}\nand {} more; `takt config check --json FILE` lists them all", problems.substr(0, end), more);
}

}  // namespace takt::cli
