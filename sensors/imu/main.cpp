// SPDX-License-Identifier: Apache-2.0
// takt-imu: an Xsens MTi on a serial port or a CAN bus, as the IMU of a robot.
// Exit codes: 0 ended by a signal, 64 usage, 65 robot file refused, 69 another process serves the sensor, 70 internal.
#include <fmt/format.h>
#include <poll.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "config/units.hpp"
#include "drivers/bus/open_bus.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "executive/program/program.hpp"
#include "sensors/imu/listen.hpp"
#include "sensors/imu/serial_port.hpp"

namespace takt::sensors {
namespace {

constexpr Duration kRetry = milliseconds(500);

struct Options : program::RobotOptions {
  std::string port, bus;
  std::string can_ids = "0x006,0x021,0x032,0x034";
  std::vector<std::string> rpy{"0 rad", "0 rad", "0 rad"};
  std::uint32_t baud = 115'200;
};

// Where the part is, beside a serial port.
struct Source {
  std::string directory;  // the robot's runtime directory
  std::optional<config::Bus> bus{};
  MtCanIds ids{};
};

// Signals come while it waits for bytes, and at no other time. Returns the mask to wait with.
sigset_t hold_signals() {
  sigset_t ours, before;
  sigemptyset(&ours);
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&ours, number);
  pthread_sigmask(SIG_BLOCK, &ours, &before);
  return before;
}

int refuse(int exit_code, const std::string& sentence) {
  return program::refuse(exit_code, "takt-imu: " + sentence);
}

std::string listen(const Options& options, const Source& source, ImuSeat& seat, const Signals& signals) {
  return source.bus ? listen_can(*source.bus, source.directory, source.ids, seat, signals)
                    : listen_serial(options.port, options.baud, seat, signals);
}

int serve(const Options& options, const Source& source, ImuSeat seat) {
  const std::atomic<bool>& stop = program::stop_on_signals();
  const Signals signals{.stop = stop, .while_waiting = hold_signals()};
  const timespec pause{.tv_sec = 0, .tv_nsec = kRetry.ns};
  while (!stop) {
    const std::string why = listen(options, source, seat, signals);
    if (!why.empty()) seat.complaint.say(monotonic_now(), why);
    if (!stop) ::ppoll(nullptr, 0, &pause, &signals.while_waiting);
  }
  return 0;
}

std::expected<Quaternion, std::string> mounting_of(const Options& options) {
  config::Vector3 rpy{};
  for (std::size_t i = 0; i < rpy.size(); ++i) {
    const auto angle = config::parse_quantity(options.rpy[i], config::Dimension::angle);
    if (!angle) return std::unexpected("--rpy: " + angle.error());
    rpy[i] = *angle;
  }
  return rotation_of(rpy);
}

// On a bus of the robot's, whose drives must not have those ids.
std::expected<void, std::string> find_bus(const Options& options, const config::RobotConfig& robot, Source& source) {
  const auto found = std::ranges::find(robot.buses, options.bus, &config::Bus::name);
  if (found == robot.buses.end())
    return std::unexpected(
        fmt::format("{}: no bus is called `{}`: --bus takes a name of `buses`", robot.file, options.bus));
  source.bus = *found;
  const auto index = static_cast<std::size_t>(found - robot.buses.begin());
  for (const config::IdPattern& drive : drivers::host_ids(robot, index))
    for (const config::IdPattern& id : source.ids)
      if (overlap(drive, id))
        return std::unexpected(fmt::format(
            "{}: a drive on bus {} has {} too: give the MTi other ids in MT Manager, and say them by --can-ids",
            robot.file, options.bus, text_of(id)));
  return {};
}

int run(const Options& options) {
  if (options.port.empty() == options.bus.empty())
    return refuse(kExitUsage,
                  "say where the MTi is: --port for a serial port, or --bus for a CAN bus of the robot file");
  const auto ids = parse_mt_can_ids(options.can_ids);
  if (!ids) return refuse(kExitUsage, "--can-ids: " + ids.error());
  if (!is_known_baud(options.baud))
    return refuse(kExitUsage, fmt::format("--baud: {} is none of {}", options.baud, known_bauds()));
  const auto mounting = mounting_of(options);
  if (!mounting) return refuse(kExitUsage, mounting.error());
  const auto robot = config::load(options.robot);
  if (!robot) return refuse(config::kExitBadConfiguration, robot.error());
  if (!robot->imu)
    return refuse(config::kExitBadConfiguration,
                  robot->file + ": the robot has no `imu`: add it, and its sensor (docs/sensors.md)");
  const std::string directory = program::runtime_directory_of(options, *robot);
  Source source{.directory = directory, .ids = *ids};
  if (!options.bus.empty())
    if (const auto bus = find_bus(options, *robot, source); !bus)
      return refuse(config::kExitBadConfiguration, bus.error());
  const auto server = ipc::SensorServer::start(config::sensor_socket(directory, robot->imu->sensor));
  if (!server) return refuse(kExitUnavailable, server.error());
  const std::string place = source.bus ? source.bus->interface : fmt::format("{}, {} baud", options.port, options.baud);
  return serve(options, source, {.server = **server, .mounting = *mounting, .place = place});
}

}  // namespace
}  // namespace takt::sensors

int main(int argc, char** argv) {
  namespace program = takt::program;
  takt::sensors::Options options;
  CLI::App app(
      "Serves a robot's IMU from an Xsens MTi on a serial port or a CAN bus (docs/sensors.md).\n"
      "Example: takt-imu --robot robot.yaml --port /dev/serial/by-id/usb-Xsens-if00-port0 --baud 460800");
  program::add_robot(app, options, "robot file with `imu`");
  app.add_option("--port", options.port, "serial device; waited for while it is not there");
  app.add_option("--baud", options.baud, "as the MTi is set; default 115200");
  app.add_option("--bus", options.bus, "instead of --port: CAN bus, by its name in the robot file");
  app.add_option("--can-ids", options.can_ids,
                 "of Group Counter, Quaternion, Rate of Turn, Acceleration; default 0x006,0x021,0x032,0x034");
  app.add_option("--rpy", options.rpy,
                 "how the sensor sits in the base frame: fixed-axis roll, pitch, yaw (`0 deg,180 deg,0 deg`)")
      ->delimiter(',')
      ->expected(3);
  program::add_runtime_directory(app, options);
  app.footer(
      "Exit codes: 0 ended by a signal, 64 command line, 65 robot file refused, 69 another process serves the\n"
      "sensor, 70 bug.");
  if (const auto ended = program::parse(app, argc, argv)) return *ended;
  return program::run("takt-imu", [&] { return takt::sensors::run(options); });
}
