#include "monitor/cli/direct_bus.hpp"

#include <fmt/format.h>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "drivers/open_bus.hpp"

namespace takt::cli {
namespace {

constexpr const char* kServiceRuntimeDirectory = "/run/takt";  // of the systemd units

}  // namespace

std::expected<DirectRobot, Refusal> load_robot(const std::string& robot_file, const std::string& runtime_directory) {
  auto robot = config::load(robot_file);
  if (!robot) return std::unexpected(Refusal{config::kExitBadConfiguration, robot.error()});
  if (!runtime_directory.empty()) return DirectRobot{std::move(*robot), runtime_directory, {runtime_directory}};
  std::string own = config::default_runtime_directory(robot->robot);
  return DirectRobot{std::move(*robot), own, {own, kServiceRuntimeDirectory}};
}

std::expected<std::size_t, Refusal> find_joint(const DirectRobot& robot, const std::string& name) {
  std::string known;
  for (std::size_t joint = 0; joint < robot.config.joints.size(); ++joint) {
    if (robot.config.joints[joint].name == name) return joint;
    known += (joint == 0 ? "" : ", ") + robot.config.joints[joint].name;
  }
  return std::unexpected(
      Refusal{kExitUsage, fmt::format("{} has no joint `{}`; it has {}", robot.config.file, name, known)});
}

std::expected<std::unique_ptr<drivers::CanBus>, Refusal> open_bus(const DirectRobot& robot, std::size_t bus) {
  auto opened = drivers::open_bus(robot.config.buses.at(bus), robot.runtime_directory);
  if (!opened) return std::unexpected(Refusal{kExitUnavailable, opened.error()});
  return std::move(opened->bus);
}

}  // namespace takt::cli
