// takt bus up: the kernel's CAN interfaces get the bit timing of the robot file, so that it stands in one place only.
#include <fmt/format.h>
#include <net/if.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <vector>

#include "cli/command.hpp"
#include "cli/robot/direct_bus.hpp"
#include "cli/robot/executive_guard.hpp"
#include "cli/run/external_tool.hpp"
#include "config/load.hpp"
#include "drivers/bus/socketcan_bus.hpp"

namespace takt::cli {
namespace {

struct BusUpOptions {
  std::string robot_file, interface;
  bool dry_run = false;
};

// A bus of 1 kHz that is down should not hide behind a long queue: frames older than a few periods are worthless. The
// kernel's default of 10 is less than what twelve drives get in one period.
constexpr std::size_t kFewestQueued = 32, kQueuedPerDrive = 8;
// After bus-off the controller rejoins by itself; the executive latches the fault and disables the drives meanwhile.
constexpr int kRestart_ms = 100;

using Words = std::vector<std::string>;

std::string line_of(const Words& words) {
  std::string line;
  for (const std::string& word : words) line += (line.empty() ? "" : " ") + word;
  return line;
}

// What the robot file leaves to the kernel is not mentioned. `phase`: "d" for the data phase.
void add_timing(const std::string& phase, double sample_point, std::uint32_t sjw, Words& words) {
  if (sample_point > 0) words.insert(words.end(), {phase + "sample-point", fmt::format("{:.3f}", sample_point)});
  if (sjw > 0) words.insert(words.end(), {phase + "sjw", std::to_string(sjw)});
}

std::vector<Words> commands_for(const config::RobotConfig& robot, std::size_t index) {
  const config::Bus& bus = robot.buses[index];
  std::size_t drives = 0;
  for (const config::Joint& joint : robot.joints) drives += joint.bus == index ? 1 : 0;
  const std::string queue = std::to_string(std::max(kFewestQueued, kQueuedPerDrive * drives));
  std::vector<Words> all{{"ip", "link", "set", bus.interface, "down"}};
  if (!drivers::SocketCanBus::is_virtual(bus.interface)) {  // a virtual one has no bit rate
    Words type{"ip", "link", "set", bus.interface, "type", "can", "bitrate", std::to_string(bus.bitrate)};
    add_timing("", bus.sample_point, bus.sjw, type);
    if (bus.fd) {
      type.insert(type.end(), {"dbitrate", std::to_string(bus.data_bitrate)});
      add_timing("d", bus.data_sample_point, bus.data_sjw, type);
      type.insert(type.end(), {"fd", "on"});
    }
    type.insert(type.end(), {"restart-ms", std::to_string(kRestart_ms)});
    all.push_back(std::move(type));
  } else if (bus.fd) {
    all.push_back({"ip", "link", "set", bus.interface, "mtu", "72"});
  }
  all.push_back({"ip", "link", "set", bus.interface, "txqueuelen", queue, "up"});
  return all;
}

std::expected<void, Refusal> bring_up(const config::RobotConfig& robot, std::size_t index, bool dry_run) {
  const config::Bus& bus = robot.buses[index];
  if (!dry_run && !std::filesystem::exists("/sys/class/net/" + bus.interface))
    return std::unexpected(Refusal{
        kExitUnavailable,
        fmt::format("this machine has no interface {}: plug the adapter in, or load its driver", bus.interface)});
  for (const Words& words : commands_for(robot, index)) {
    if (dry_run) {
      fmt::print("{}\n", line_of(words));
      continue;
    }
    const ToolResult result = run_tool(words);
    if (result.exit_code == kToolMissing)
      return std::unexpected(Refusal{kExitUnavailable, "`ip` is not installed: apt-get install iproute2"});
    if (result.exit_code != 0)
      return std::unexpected(
          Refusal{kExitFailed, fmt::format("`{}` failed: {}; it needs root or CAP_NET_ADMIN", line_of(words),
                                           result.output.substr(0, result.output.find('\n')))});
  }
  if (!dry_run) fmt::print("{} is up for bus {}\n", bus.interface, bus.name);
  return {};
}

bool is_up(const std::string& interface) {
  std::ifstream file("/sys/class/net/" + interface + "/flags");
  unsigned flags = 0;
  return (file >> std::hex >> flags) && (flags & IFF_UP) != 0;
}

std::expected<int, Refusal> up(const BusUpOptions& options) {
  const auto robot = load_robot(options.robot_file, {});
  if (!robot) return std::unexpected(robot.error());
  std::vector<std::size_t> chosen;
  bool carries = false;  // one of them: it would be taken from under a robot that moves
  for (std::size_t index = 0; index < robot->config.buses.size(); ++index) {
    const std::string& interface = robot->config.buses[index].interface;
    if (!options.interface.empty() && interface != options.interface) continue;
    chosen.push_back(index);
    carries = carries || is_up(interface);
  }
  if (chosen.empty())
    return std::unexpected(
        Refusal{kExitUsage, fmt::format("{} has no bus on interface {}", options.robot_file, options.interface)});
  if (carries && !options.dry_run) {
    if (const auto disarmed = require_disarmed(robot->executives); !disarmed) return std::unexpected(disarmed.error());
  }
  for (const std::size_t index : chosen) {
    if (const auto done = bring_up(robot->config, index, options.dry_run); !done) return std::unexpected(done.error());
  }
  return kExitOk;
}

}  // namespace

void add_bus_up(CLI::App& bus, int& exit_code) {
  CLI::App* command = bus.add_subcommand("up", "Give the CAN interfaces the robot file's bit rates and bring them up.");
  auto options = std::make_shared<BusUpOptions>();
  command->add_option("--robot", options->robot_file, "robot file")->required();
  command->add_option("--interface", options->interface, "only this one");
  command->add_flag("--dry-run", options->dry_run, "print the commands instead of running them");
  command->footer(
      "Example: sudo takt bus up --robot robot.yaml\n"
      "takt-can@IFACE.service does this for one interface when its adapter appears.\n"
      "Refused of interfaces that are up while the robot is armed: they go down before their bit rates change.\n"
      "Exit codes: 0 up, 1 armed, or the kernel refused, 64 command line, 65 configuration, 69 no such interface.");
  command->callback([options, &exit_code] {
    const auto done = up(*options);
    if (!done) fmt::print(stderr, "takt bus up: {}\n", done.error().sentence);
    exit_code = done ? *done : done.error().exit_code;
  });
}

}  // namespace takt::cli
