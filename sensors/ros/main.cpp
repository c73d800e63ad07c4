// SPDX-License-Identifier: Apache-2.0
// takt-ros-sensors: topics of ROS 2 as the sensors of a robot whose entries have `ros`.
// Exit codes: 0 ended by a signal, 64 usage, 65 robot file refused, 69 no DDS domain, or another process serves a
// sensor, 70 internal.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "dds/domain.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "executive/program/program.hpp"
#include "sensors/ros/ros_topic_reader.hpp"

namespace takt::sensors {
namespace {

// A signal is heeded within this. No sample is younger than the wait in which it was taken: a short one makes few of
// them older than they are.
constexpr Duration kPatience = milliseconds(5);
constexpr Duration kReportPeriod = seconds(10);

int refuse(int exit_code, const std::string& sentence) {
  return program::refuse(exit_code, "takt-ros-sensors: " + sentence);
}

struct Served {
  std::unique_ptr<ipc::SensorServer> server;
  std::unique_ptr<RosTopicReader> reader;
};

void serve(const dds::Domain& domain, std::vector<Served>& sensors, const std::atomic<bool>& stop) {
  const dds_entity_t wait_set = dds_create_waitset(domain.participant());
  for (const Served& sensor : sensors)
    dds_waitset_attach(wait_set, dds_create_readcondition(sensor.reader->reader(), DDS_ANY_STATE), 0);
  MonoTime reported = monotonic_now();
  WaitStart waits(kPatience);
  while (!stop) {
    waits.begin(monotonic_now());
    dds_waitset_wait(wait_set, nullptr, 0, kPatience.ns);
    for (const Served& sensor : sensors) sensor.reader->take_all(waits);
    if (const MonoTime now = monotonic_now(); now - reported >= kReportPeriod) {
      for (const Served& sensor : sensors) sensor.reader->report();
      reported = now;
    }
  }
  for (const Served& sensor : sensors) sensor.reader->report();
}

int run(const program::RobotOptions& options) {
  const auto robot = config::load(options.robot);
  if (!robot) return refuse(config::kExitBadConfiguration, robot.error());
  std::vector<const config::Sensor*> wanted;
  for (const config::Sensor& sensor : robot->sensors)
    if (sensor.ros) wanted.push_back(&sensor);
  if (wanted.empty())
    return refuse(config::kExitBadConfiguration,
                  robot->file + ": none of its `sensors` has `ros`: name the topic there (docs/sensors.md)");
  const auto reader = program::policy_user_of(options);
  if (!reader) return refuse(kExitUsage, reader.error());
  const std::string directory = program::runtime_directory_of(options, *robot);
  const std::atomic<bool>& stop = program::stop_on_signals();
  const auto domain = dds::Domain::open(*robot, "takt-ros-sensors " + robot->robot);
  if (!domain) return refuse(kExitUnavailable, domain.error());
  std::vector<Served> sensors;
  for (const config::Sensor* sensor : wanted) {
    const ipc::RingShape shape =
        sensor->image ? ipc::image_mailbox(sensor->image->height, sensor->image->width, sensor->image->channels)
                      : ipc::sensor_mailbox();
    auto server = ipc::SensorServer::start(config::sensor_socket(directory, sensor->name), *reader, shape);
    if (!server) return refuse(kExitUnavailable, server.error());
    auto topic = RosTopicReader::open(*domain, *sensor, **server);
    if (!topic) return refuse(kExitUnavailable, topic.error());
    sensors.push_back({std::move(*server), std::move(*topic)});
  }
  spdlog::info("DDS: domain {} on {}: {} topics", robot->dds->domain, robot->dds->interface, sensors.size());
  serve(*domain, sensors, stop);
  return 0;
}

}  // namespace
}  // namespace takt::sensors

int main(int argc, char** argv) {
  namespace program = takt::program;
  program::RobotOptions options;
  CLI::App app(
      "Serves the sensors of a robot whose entries in the robot file have `ros`, from topics of ROS 2 "
      "(docs/sensors.md).\nExample: takt-ros-sensors --robot robot.yaml");
  program::add_robot(app, options, "robot file with `dds`, and `ros` in its sensors");
  program::add_runtime_directory(app, options);
  program::add_policy_user(app, options, "may read the sensors, too");
  app.footer(
      "Exit codes: 0 ended by a signal, 64 command line, 65 robot file refused, 69 no DDS domain, or another process\n"
      "serves a sensor, 70 bug.");
  if (const auto ended = program::parse(app, argc, argv)) return *ended;
  return program::run("takt-ros-sensors", [&] { return takt::sensors::run(options); });
}
