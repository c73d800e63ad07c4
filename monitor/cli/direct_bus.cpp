#include "monitor/cli/direct_bus.hpp"

#include <fmt/format.h>

#include <chrono>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "drivers/open_bus.hpp"
#include "executive/ipc/rendezvous.hpp"

namespace takt::cli {

std::expected<DirectRobot, Refusal> load_robot(const std::string& robot_file, const std::string& runtime_directory) {
  auto robot = config::load(robot_file);
  if (!robot) return std::unexpected(Refusal{config::kExitBadConfiguration, robot.error()});
  std::string directory =
      runtime_directory.empty() ? config::default_runtime_directory(robot->robot) : runtime_directory;
  return DirectRobot{std::move(*robot), std::move(directory)};
}

std::expected<void, Refusal> require_no_executive(const DirectRobot& robot) {
  const auto reply =
      ipc::ask(config::executive_socket(robot.runtime_directory), OperatorVerb::status, std::chrono::milliseconds(500));
  if (!reply) return {};
  return std::unexpected(Refusal{
      kExitFailed, fmt::format("an executive runs in {}, mode {}: two masters on one bus fight over its drives; end it "
                               "first",
                               robot.runtime_directory, name(reply->status.tick.mode))});
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
