#include "executive/runtime/open_edge.hpp"

#include <thread>
#include <utility>

#include "drivers/bus/open_bus.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::runtime {
namespace {

using namespace std::chrono_literals;

std::expected<drivers::OpenedBus, std::string> open_patiently(const config::RobotConfig& robot, std::size_t index,
                                                              const std::string& runtime_directory,
                                                              std::chrono::steady_clock::time_point give_up_at) {
  const config::Bus& bus = robot.buses[index];
  const auto wanted = drivers::host_ids(robot, index);
  while (true) {
    auto opened = drivers::open_bus(bus, runtime_directory, wanted);
    const bool may_come = bus.when_missing == config::WhenBusMissing::loopback;
    if (opened || !may_come || std::chrono::steady_clock::now() >= give_up_at) return opened;
    std::this_thread::sleep_for(20ms);
  }
}

}  // namespace

std::expected<OpenedEdge, std::string> open_edge(const config::RobotConfig& robot, const std::string& runtime_directory,
                                                 std::chrono::milliseconds hub_patience) {
  std::vector<JointOnBus> joints;
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    auto driver = drivers::make_joint_driver(robot, joint);
    if (!driver) return std::unexpected(driver.error());
    joints.push_back({std::move(*driver), robot.joints[joint].bus});
  }
  const auto give_up_at = std::chrono::steady_clock::now() + hub_patience;
  std::vector<std::unique_ptr<drivers::CanBus>> buses;
  std::vector<std::string> descriptions;
  for (std::size_t i = 0; i < robot.buses.size(); ++i) {
    auto opened = open_patiently(robot, i, runtime_directory, give_up_at);
    if (!opened) return std::unexpected(opened.error());
    buses.push_back(std::move(opened->bus));
    descriptions.push_back(std::move(opened->description));
  }
  return OpenedEdge{DriveEdge(std::move(buses), std::move(joints), std::make_unique<drivers::WireGuard>(robot)), std::move(descriptions)};
}

}  // namespace takt::runtime
