// SPDX-License-Identifier: Apache-2.0
// takt bus scan: who answers on a robot's buses.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdio>
#include <ctime>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/command.hpp"
#include "cli/robot/direct_bus.hpp"
#include "drivers/tools/discovery.hpp"
#include "executive/contract/monotonic_clock.hpp"

namespace takt::cli {
namespace {

using drivers::BusScan;

struct BusScanOptions {
  std::string robot_file, runtime_dir;
  std::uint32_t last_id = 127;
  bool json = false;
};

struct Line {
  std::string bus, protocol;
  std::uint32_t id = 0;
  std::string joint;  // empty: not in the robot file
  std::set<std::string> said;
  bool answered = true;
};

void pause(Duration how_long) {
  const timespec time{how_long.ns / 1'000'000'000, how_long.ns % 1'000'000'000};
  ::nanosleep(&time, nullptr);
}

BusScan scan_for(const config::RobotConfig& robot, std::size_t bus, std::uint32_t last_id) {
  std::set<config::DriveProtocol> protocols;
  for (const config::Joint& joint : robot.joints)
    if (joint.bus == bus) protocols.insert(joint.drive.protocol);
  BusScan scan(protocols, protocols.contains(config::DriveProtocol::odrive) ? 0 : 1, last_id);
  for (const config::Joint& joint : robot.joints)
    if (const auto question = drivers::disabling_question(joint.drive); joint.bus == bus && question)
      scan.also_ask(*question);
  return scan;
}

// One question a millisecond, then silence to listen to.
void ask_around(BusScan& scan, drivers::CanBus& bus) {
  std::vector<drivers::ReceivedFrame> received(64);
  const MonoTime started = monotonic_now();
  const Duration length = milliseconds(1) * static_cast<std::int64_t>(scan.questions()) + drivers::kListen;
  while (monotonic_now() - started < length) {
    if (const auto question = scan.next_question()) bus.send(*question);
    pause(milliseconds(1));
    const std::size_t count = bus.receive(received);
    for (std::size_t i = 0; i < count; ++i) scan.take(received[i].frame);
  }
}

std::vector<Line> compare(const BusScan& scan, const config::RobotConfig& robot, std::size_t bus) {
  std::vector<Line> lines;
  std::vector<bool> heard(robot.joints.size());
  for (const BusScan::Drive& drive : scan.found()) {
    Line line{robot.buses[bus].name, std::string(config::name(drive.protocol)), drive.id, "", drive.said};
    for (std::size_t j = 0; j < robot.joints.size(); ++j) {
      const config::Joint& joint = robot.joints[j];
      if (joint.bus != bus || joint.drive.protocol != drive.protocol || joint.drive.id != drive.id) continue;
      line.joint = joint.name;
      heard[j] = true;
    }
    lines.push_back(std::move(line));
  }
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const config::Joint& joint = robot.joints[j];
    if (joint.bus != bus || heard[j]) continue;
    lines.push_back({robot.buses[bus].name,
                     std::string(config::name(joint.drive.protocol)),
                     joint.drive.id,
                     joint.name,
                     {},
                     false});
  }
  return lines;
}

void print(const std::vector<Line>& lines, bool as_json) {
  if (as_json) {
    nlohmann::ordered_json json = nlohmann::ordered_json::array();
    for (const Line& line : lines)
      json.push_back({{"bus", line.bus},
                      {"protocol", line.protocol},
                      {"id", line.id},
                      {"joint", line.joint.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(line.joint)},
                      {"answered", line.answered},
                      {"said", line.said}});
    fmt::print("{}\n", json.dump());
    return;
  }
  fmt::print("{:<8} {:<9} {:>5}  {:<20} {}\n", "bus", "protocol", "id", "joint", "said");
  for (const Line& line : lines)
    fmt::print("{:<8} {:<9} {:>5}  {:<20} {}\n", line.bus, line.protocol, line.id,
               line.joint.empty() ? "(not in the file)" : line.joint,
               line.answered ? fmt::format("{}", fmt::join(line.said, "; ")) : "NO ANSWER");
}

std::expected<int, Refusal> scan(const BusScanOptions& options) {
  const auto robot = load_robot(options.robot_file, options.runtime_dir);
  if (!robot) return std::unexpected(robot.error());
  const auto alone = require_alone(*robot);
  if (!alone) return std::unexpected(alone.error());
  std::vector<Line> lines;
  for (std::size_t bus = 0; bus < robot->config.buses.size(); ++bus) {
    auto opened = open_bus(*robot, bus);
    if (!opened) return std::unexpected(opened.error());
    BusScan scan = scan_for(robot->config, bus, options.last_id);
    ask_around(scan, **opened);
    const auto found = compare(scan, robot->config, bus);
    lines.insert(lines.end(), found.begin(), found.end());
  }
  print(lines, options.json);
  return std::ranges::all_of(lines, &Line::answered) ? kExitOk : kExitFailed;
}

}  // namespace

void add_bus_scan(CLI::App& bus, int& exit_code) {
  CLI::App* command = bus.add_subcommand("scan", "Ask every number on every bus who is there; moves nothing.");
  auto options = std::make_shared<BusScanOptions>();
  command->add_option("--robot", options->robot_file, "robot file: its buses, and the protocols spoken on each")
      ->required();
  command->add_option("--runtime-dir", options->runtime_dir,
                      "where loopback buses are (default ROBOT in $XDG_RUNTIME_DIR/takt, as root /run/takt)");
  command->add_option("--last-id", options->last_id, "highest number asked")
      ->check(CLI::Range(1, 127))
      ->capture_default_str();
  command->add_flag("--json", options->json, "one line of JSON");
  command->footer(
      "Example: takt bus scan --robot robot.yaml\n"
      "Damiao drives tell their packed ranges, to compare with the file; T-Motor drives are found where the file has "
      "them.\n"
      "Exit codes: 0 every joint's drive answered, 1 some did not or an executive runs, 64 command line, 65 "
      "configuration, 69 a bus is not there.");
  command->callback([options, &exit_code] {
    const auto done = scan(*options);
    if (!done) fmt::print(stderr, "takt bus scan: {}\n", done.error().sentence);
    exit_code = done ? *done : done.error().exit_code;
  });
}

}  // namespace takt::cli
