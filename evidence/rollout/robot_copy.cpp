// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/robot_copy.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "config/hash.hpp"
#include "config/observation_shape.hpp"
#include "config/policy_signature.hpp"

namespace takt::evidence {
namespace {

namespace fs = std::filesystem;

std::expected<void, std::string> link_files(const std::vector<std::string>& files, const config::RobotConfig& robot,
                                            const std::string& folder) {
  const fs::path home = fs::absolute(robot.file).lexically_normal().parent_path();
  for (const std::string& part : files) {
    const fs::path path = fs::absolute(part).lexically_normal(), name = path.lexically_relative(home);
    if (name.empty() || name.string().starts_with(".."))
      return std::unexpected(fmt::format("{} must lie in the robot file's folder or below", part));
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

// Written with its whole path it is found from everywhere.
bool is_found_from_everywhere(const char* key, const std::string& file, const config::RobotConfig& robot) {
  return robot.resolved.contains(fmt::format("{}: \"{}\"", key, fs::absolute(file).string()));
}

std::expected<void, std::string> link_policy(const config::Policy& policy, const config::RobotConfig& robot,
                                             const std::string& folder) {
  std::vector<std::string> files;
  if (!is_found_from_everywhere("file", policy.file, robot)) {
    files = config::policy_files(policy.file);
    if (policy.names_key()) files.push_back(config::signature_of_policy(policy.file));
  }
  if (policy.names_key() && !is_found_from_everywhere("signed_by", policy.signed_by, robot))
    files.push_back(policy.signed_by);
  return link_files(files, robot, folder);
}

}  // namespace

std::expected<void, std::string> write_robot(const config::RobotConfig& robot, const std::string& folder) {
  std::ofstream file(folder + "/robot.yaml", std::ios::binary);
  file << robot.resolved;
  if (!file.flush()) return std::unexpected(folder + "/robot.yaml cannot be written: is the disk full?");
  if (const config::Fallback* const fallback = config::fallback_policy_of(robot))
    if (auto linked = link_policy(*config::seen_by_fallback(robot, *fallback).policy, robot, folder); !linked)
      return linked;
  return link_policy(*robot.policy, robot, folder);
}

}  // namespace takt::evidence
