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
#include "executive/contract/version.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "executive/log/program_log.hpp"
#include "sensors/ros/ros_topic_reader.hpp"

namespace takt::sensors {
namespace {

constexpr int kExitUsage = 64, kExitUnavailable = 69, kExitInternal = 70;
// A signal is heeded within this. No sample is younger than the wait in which it was taken: a short one makes few of
// them older than they are.
constexpr Duration kPatience = milliseconds(5);
constexpr Duration kReportPeriod = seconds(10);

struct Options {
  std::string robot, runtime_directory, policy_user;
};

std::atomic<bool> g_stop = false;
static_assert(std::atomic<bool>::is_always_lock_free);

void stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { g_stop = true; };
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) sigaction(number, &action, nullptr);
}

int refuse(int exit_code, const std::string& sentence) {
  std::fprintf(stderr, "takt-ros-sensors: %s\n", sentence.c_str());
  return exit_code;
}

struct Served {
  std::unique_ptr<ipc::SensorServer> server;
  std::unique_ptr<RosTopicReader> reader;
};

void serve(const dds::Domain& domain, std::vector<Served>& sensors) {
  const dds_entity_t wait_set = dds_create_waitset(domain.participant());
  for (const Served& sensor : sensors)
    dds_waitset_attach(wait_set, dds_create_readcondition(sensor.reader->reader(), DDS_ANY_STATE), 0);
  MonoTime reported = monotonic_now();
  WaitStart waits(kPatience);
  while (!g_stop) {
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

int run(const Options& options) {
  const auto robot = config::load(options.robot);
  if (!robot) return refuse(config::kExitBadConfiguration, robot.error());
  std::vector<const config::Sensor*> wanted;
  for (const config::Sensor& sensor : robot->sensors)
    if (sensor.ros) wanted.push_back(&sensor);
  if (wanted.empty())
    return refuse(config::kExitBadConfiguration,
                  robot->file + ": none of its `sensors` has `ros`: name the topic there (docs/sensors.md)");
  std::optional<uid_t> reader;
  if (!options.policy_user.empty()) {
    const auto user = ipc::user_id(options.policy_user);
    if (!user) return refuse(kExitUsage, "--policy-user: " + user.error());
    reader = *user;
  }
  const std::string directory =
      options.runtime_directory.empty() ? config::default_runtime_directory(robot->robot) : options.runtime_directory;
  stop_on_signals();
  const auto domain = dds::Domain::open(*robot, "takt-ros-sensors " + robot->robot);
  if (!domain) return refuse(kExitUnavailable, domain.error());
  std::vector<Served> sensors;
  for (const config::Sensor* sensor : wanted) {
    const ipc::RingShape shape =
        sensor->image ? ipc::image_mailbox(sensor->image->height, sensor->image->width, sensor->image->channels)
                      : ipc::sensor_mailbox();
    auto server = ipc::SensorServer::start(config::sensor_socket(directory, sensor->name), reader, shape);
    if (!server) return refuse(kExitUnavailable, server.error());
    auto topic = RosTopicReader::open(*domain, *sensor, **server);
    if (!topic) return refuse(kExitUnavailable, topic.error());
    sensors.push_back({std::move(*server), std::move(*topic)});
  }
  spdlog::info("DDS: domain {} on {}: {} topics", robot->dds->domain, robot->dds->interface, sensors.size());
  serve(*domain, sensors);
  return 0;
}

}  // namespace
}  // namespace takt::sensors

int main(int argc, char** argv) {
  takt::sensors::Options options;
  CLI::App app(
      "Serves the sensors of a robot whose entries in the robot file have `ros`, from topics of ROS 2 "
      "(docs/sensors.md).\nExample: takt-ros-sensors --robot robot.yaml");
  app.add_option("--robot", options.robot, "robot file with `dds`, and `ros` in its sensors")->required();
  app.add_option("--runtime-dir", options.runtime_directory,
                 "where sockets live (default ROBOT in $XDG_RUNTIME_DIR/takt, as root /run/takt)");
  app.add_option("--policy-user", options.policy_user, "a user who may read the sensors, too; default: ours only");
  app.set_version_flag("--version", std::string(takt::version()));
  app.footer(
      "Exit codes: 0 ended by a signal, 64 command line, 65 robot file refused, 69 no DDS domain, or another process\n"
      "serves a sensor, 70 bug.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : takt::sensors::kExitUsage;
  }
  try {
    takt::log::log_to_stderr("takt-ros-sensors");
    return takt::sensors::run(options);
  } catch (const std::exception& error) {
    return takt::sensors::refuse(takt::sensors::kExitInternal, std::string("internal error: ") + error.what());
  }
}
