// SPDX-License-Identifier: Apache-2.0
// takt bus scan: who answers on a robot's buses.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/robot/asked_drives.hpp"
#include "commissioning/discovery.hpp"
#include "executive/contract/monotonic_clock.hpp"

namespace takt::cli {
namespace {

using commissioning::BusScan;

struct BusScanOptions {
  std::string robot_file, runtime_dir;
  std::uint32_t last_id = 127;
  bool json = false;
};

struct Line {
  std::string bus{}, protocol{};
  std::uint32_t id = 0;
  std::string joint{};  // empty: not in the robot file
  std::set<std::string> said{};
  std::vector<std::string> differs{};  // what is not as the robot file has it
  bool answered = true;
};

// What a scan heard of every bus, and what the drives said when they were set up, disabled, as the executive does it.
struct Heard {
  std::vector<std::vector<BusScan::Drive>> drives;  // by bus
  std::vector<JointFeedback> feedback;              // by joint
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
    if (joint.bus == bus)
      for (const drivers::CanFrame& question : commissioning::own_questions(joint.drive, robot.buses[bus]))
        scan.also_ask(question);
  return scan;
}

// One question a millisecond, then silence to listen to.
void ask_around(BusScan& scan, drivers::CanBus& bus) {
  std::vector<drivers::ReceivedFrame> received(64);
  const MonoTime started = monotonic_now();
  const Duration length = milliseconds(1) * static_cast<std::int64_t>(scan.questions()) + commissioning::kListen;
  while (monotonic_now() - started < length) {
    if (const auto question = scan.next_question()) bus.send(*question);
    pause(milliseconds(1));
    const std::size_t count = bus.receive(received);
    for (std::size_t i = 0; i < count; ++i) scan.take(received[i].frame);
  }
}

constexpr int kSetUpPeriods = 3000;  // at most

// Until every drive is disabled and as the robot file has it.
std::expected<std::vector<JointFeedback>, Refusal> set_up_drives(const DirectRobot& robot) {
  auto drives = AskedDrives::open(robot);
  if (!drives) return std::unexpected(drives.error());
  if (!drives->missing().empty()) return std::unexpected(Refusal{kExitUnavailable, drives->missing().front()});
  const auto fits = [&drives](std::size_t joint) {
    const JointFeedback& feedback = drives->feedback(joint);
    return feedback.received_at.is_set() && drives->is_set_up(joint) && feedback.drive_state == DriveState::disabled &&
           feedback.error_code == 0;
  };
  std::vector<JointFeedback> feedback(drives->count());
  bool all = false;
  for (int period = 0; period < kSetUpPeriods && !all; ++period) {
    drives->turn();
    pause(robot.config.control.period);
    all = true;
    for (std::size_t joint = 0; joint < drives->count(); ++joint) all = fits(joint) && all;
  }
  for (std::size_t joint = 0; joint < drives->count(); ++joint) feedback[joint] = drives->feedback(joint);
  return feedback;
}

const BusScan::Drive* heard_of(const config::Joint& joint, const Heard& heard) {
  for (const BusScan::Drive& drive : heard.drives[joint.bus])
    if (joint.drive.protocol == drive.protocol && joint.drive.id == drive.id) return &drive;
  return nullptr;
}

Line joint_line(const config::Joint& joint, const config::RobotConfig& robot, const BusScan::Drive* drive,
                const JointFeedback& feedback) {
  Line line{.bus = robot.buses[joint.bus].name,
            .protocol = std::string(config::name(joint.drive.protocol)),
            .id = joint.drive.id,
            .joint = joint.name,
            .said = {},
            .differs = commissioning::differences(joint, drive, feedback),
            .answered = drive != nullptr || feedback.received_at.is_set()};
  if (drive != nullptr) line.said = drive->said;
  return line;
}

// Every joint, and the drives that are none's, by bus.
std::vector<Line> compare(const Heard& heard, const config::RobotConfig& robot) {
  std::vector<Line> lines;
  for (std::size_t bus = 0; bus < robot.buses.size(); ++bus) {
    for (std::size_t j = 0; j < robot.joints.size(); ++j)
      if (robot.joints[j].bus == bus)
        lines.push_back(joint_line(robot.joints[j], robot, heard_of(robot.joints[j], heard), heard.feedback[j]));
    for (const BusScan::Drive& drive : heard.drives[bus]) {
      const bool is_known = std::ranges::any_of(robot.joints, [&](const config::Joint& joint) {
        return joint.bus == bus && joint.drive.protocol == drive.protocol && joint.drive.id == drive.id;
      });
      if (is_known) continue;
      Line line{.bus = robot.buses[bus].name, .protocol = std::string(config::name(drive.protocol)), .id = drive.id};
      line.said = drive.said;
      lines.push_back(std::move(line));
    }
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
                      {"said", line.said},
                      {"differs", line.differs}});
    fmt::print("{}\n", json_line(json));
    return;
  }
  fmt::print("{:<8} {:<9} {:>5}  {:<20} {}\n", "bus", "protocol", "id", "joint", "said");
  for (const Line& line : lines)
    fmt::print("{:<8} {:<9} {:>5}  {:<20} {}\n", line.bus, line.protocol, line.id,
               line.joint.empty() ? "(not in the file)" : line.joint,
               line.answered ? fmt::format("{}", fmt::join(line.said, "; ")) : "NO ANSWER");
  for (const Line& line : lines)
    for (const std::string& what : line.differs) fmt::print("joint {}: {}\n", line.joint, what);
}

std::expected<int, Refusal> scan(const BusScanOptions& options) {
  const auto robot = load_robot(options.robot_file, options.runtime_dir);
  if (!robot) return std::unexpected(robot.error());
  const auto alone = require_alone(*robot);
  if (!alone) return std::unexpected(alone.error());
  Heard heard;
  for (std::size_t bus = 0; bus < robot->config.buses.size(); ++bus) {
    auto opened = open_bus(*robot, bus);
    if (!opened) return std::unexpected(opened.error());
    BusScan scan = scan_for(robot->config, bus, options.last_id);
    ask_around(scan, **opened);
    heard.drives.push_back(scan.found());
  }
  auto feedback = set_up_drives(*robot);
  if (!feedback) return std::unexpected(feedback.error());
  heard.feedback = std::move(*feedback);
  const std::vector<Line> lines = compare(heard, robot->config);
  print(lines, options.json);
  return std::ranges::all_of(lines, [](const Line& line) { return line.differs.empty(); }) ? kExitOk : kExitFailed;
}

}  // namespace

void add_bus_scan(CLI::App& bus, int& exit_code) {
  CLI::App* command =
      bus.add_subcommand("scan", "Ask every number on every bus who is there, and compare; moves nothing.");
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
      "Then each drive of the file is set up as the executive does it, disabled, and what differs from the file is "
      "told: "
      "reply id,\nranges, mode, CAN FD, time-out, identity, firmware, two drives with one number. T-Motor drives tell "
      "least, and are\nfound where the file has them.\n"
      "Exit codes: 0 every joint's drive is as the file has it, 1 some differ, do not answer, or an executive runs, 64 "
      "command\nline, 65 configuration, 69 a bus is not there.");
  command->callback([options, &exit_code] {
    const auto done = scan(*options);
    if (!done) fmt::print(stderr, "takt bus scan: {}\n", done.error().sentence);
    exit_code = done ? *done : done.error().exit_code;
  });
}

}  // namespace takt::cli
