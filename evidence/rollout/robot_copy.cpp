// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/robot_copy.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>

#include "config/hash.hpp"
#include "config/observation_shape.hpp"

namespace takt::panel {
namespace {

namespace fs = std::filesystem;

std::expected<void, std::string> link_policy(const std::string& file, const config::RobotConfig& robot,
                                             const std::string& folder) {
  // Written with its whole path it is found from everywhere.
  if (robot.resolved.contains(fmt::format("file: \"{}\"", fs::absolute(file).string()))) return {};
  const fs::path home = fs::absolute(robot.file).lexically_normal().parent_path();
  for (const std::string& part : config::policy_files(file)) {
    const fs::path path = fs::absolute(part).lexically_normal(), name = path.lexically_relative(home);
    if (name.empty() || name.string().starts_with(".."))
      return std::unexpected(fmt::format("policy {} must lie in the robot file's folder or below", part));
    const fs::path link = fs::path(folder) / name;
    std::error_code error;
    fs::create_directories(link.parent_path(), error);
    if (fs::exists(link)) continue;
    fs::create_symlink(path, link, error);
    if (error)
      return std::unexpected(fmt::format("cannot link {} into {}: {}", path.string(), folder, error.message()));
  }
  return {};
}

}  // namespace

std::expected<void, std::string> write_robot(const config::RobotConfig& robot, const std::string& folder) {
  std::ofstream file(folder + "/robot.yaml", std::ios::binary);
  file << robot.resolved;
  if (!file.flush()) return std::unexpected(folder + "/robot.yaml cannot be written: is the disk full?");
  if (const config::Fallback* const fallback = config::fallback_policy_of(robot))
    if (auto linked = link_policy(config::seen_by_fallback(robot, *fallback).policy->file, robot, folder); !linked)
      return linked;
  return link_policy(robot.policy->file, robot, folder);
}

}  // namespace takt::panel
