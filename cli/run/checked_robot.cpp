#include "cli/run/checked_robot.hpp"

#include <fmt/format.h>

#include "config/load.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::cli {

std::expected<CheckedRobot, std::string> check_robot_file(const std::string& path) {
  auto robot = config::load(path);
  if (!robot) return std::unexpected(robot.error());
  std::string problems;
  if (robot->policy)
    if (const auto hash = config::policy_hash(robot->policy->file); !hash)
      problems = fmt::format("{}: {}", path, hash.error());
  // What a driver refuses, the executive would refuse at its start.
  for (std::size_t joint = 0; joint < robot->joints.size(); ++joint)
    if (const auto driver = drivers::make_joint_driver(*robot, joint); !driver)
      problems += fmt::format("{}{}: {}", problems.empty() ? "" : "\n", path, driver.error());
  auto loads = drivers::check_bus_load(*robot);
  if (!loads) problems += (problems.empty() ? "" : "\n") + loads.error();
  if (!problems.empty()) return std::unexpected(problems);
  return CheckedRobot{std::move(*robot), std::move(*loads)};
}

}  // namespace takt::cli
