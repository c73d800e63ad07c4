// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/open_edge.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <thread>
#include <utility>

#include "config/joint_units.hpp"
#include "config/turns.hpp"
#include "drivers/bus/open_bus.hpp"
#include "drivers/protocol/home_note.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "executive/contract/exit_codes.hpp"

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

void tell_of_homes(const config::RobotConfig& robot, std::span<const std::optional<drivers::HomeNote>> notes) {
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
    if (notes[joint])
      spdlog::info("joint {0}: a person said that it is at {1:.4f} {3}; its drive reads {2:.4f} {3} less",
                   robot.joints[joint].name, notes[joint]->left_at, notes[joint]->shift,
                   config::kJointPosition.unit(robot.joints[joint].kind));
}

// The first frame among those that arrived which only a controller of these drives sends.
std::optional<drivers::CanFrame> heard_command(drivers::CanBus& bus, std::span<const config::IdPattern> commands) {
  std::array<drivers::ReceivedFrame, kMaxFramesPerBus> received;
  const std::span heard = std::span(received).first(bus.receive(received));
  for (const drivers::ReceivedFrame& one : heard) {
    const auto is_it = [&one](const config::IdPattern& id) { return id.matches(one.frame.id, one.frame.extended); };
    if (std::ranges::any_of(commands, is_it)) return one.frame;
  }
  return std::nullopt;
}

// Interfaces are claimed among our own programs only: a controller of another make, or on another computer, is heard.
std::expected<void, std::string> listen_for_others(const config::RobotConfig& robot,
                                                   std::span<const std::unique_ptr<drivers::CanBus>> buses) {
  const auto until = std::chrono::steady_clock::now() + kListenFor;
  bool is_last = false;
  while (!is_last) {
    is_last = std::chrono::steady_clock::now() >= until;
    for (std::size_t bus = 0; bus < buses.size(); ++bus) {
      const auto commands = drivers::device_ids(robot, bus);
      if (const auto frame = heard_command(*buses[bus], commands))
        return std::unexpected(fmt::format(
            "{}: another controller commands our drives, heard on id 0x{:0{}x}: end that controller, then start again",
            robot.buses[bus].interface, frame->id, frame->extended ? 8 : 3));
    }
    if (!is_last) std::this_thread::sleep_for(5ms);
  }
  return {};
}

}  // namespace

std::expected<OpenedEdge, EdgeRefusal> open_edge(const config::RobotConfig& robot, const std::string& runtime_directory,
                                                 std::chrono::milliseconds hub_patience) {
  auto claims = drivers::claim_interfaces(robot.buses);
  if (!claims) return std::unexpected(EdgeRefusal{kExitSetUpRefused, claims.error()});
  const auto give_up_at = std::chrono::steady_clock::now() + hub_patience;
  std::vector<std::unique_ptr<drivers::CanBus>> buses;
  std::vector<OpenedBusFacts> facts;
  for (std::size_t i = 0; i < robot.buses.size(); ++i) {
    auto opened = open_patiently(robot, i, runtime_directory, give_up_at);
    if (!opened) return std::unexpected(EdgeRefusal{kExitUnavailable, opened.error()});
    buses.push_back(std::move(opened->bus));
    facts.push_back({std::move(opened->description), std::move(opened->link)});
  }
  if (const auto quiet = listen_for_others(robot, buses); !quiet)
    return std::unexpected(EdgeRefusal{kExitSetUpRefused, quiet.error()});
  drivers::OpenedTorqueOutput torque;
  if (robot.safe_torque_off) {
    auto output = drivers::open_torque_output(*robot.safe_torque_off);
    if (!output) return std::unexpected(EdgeRefusal{kExitSetUpRefused, output.error()});
    torque = std::move(*output);
  }
  const auto notes = drivers::take_home_notes(runtime_directory, robot);
  const config::RobotConfig homed = drivers::homed_robot(robot, notes);
  tell_of_homes(robot, notes);
  const std::vector<Turns> turns = config::turns_of(robot);
  std::vector<JointOnBus> joints;
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    auto driver = drivers::make_joint_driver(homed, joint);
    if (!driver) return std::unexpected(EdgeRefusal{kExitUnavailable, driver.error()});
    if (const auto& note = notes[joint])
      (*driver)->assume_home(static_cast<float>(note->left_at), drivers::may_have_moved(robot.joints[joint]));
    joints.push_back({std::move(*driver), robot.joints[joint].bus, turns[joint]});
  }
  return OpenedEdge{std::move(*claims),
                    DriveEdge(std::move(buses), std::move(joints), std::make_unique<drivers::WireGuard>(homed),
                              std::move(torque.output)),
                    std::move(facts), std::move(torque.description)};
}

}  // namespace takt::runtime
