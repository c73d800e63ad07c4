// SPDX-License-Identifier: Apache-2.0
// takt command: operator input (a velocity, say) as one of the robot's sensors, for as long as it is said.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/quantity_option.hpp"
#include "cli/robot/command_sensor.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "sensors/gamepad/gamepad.hpp"

namespace takt::cli {
namespace {

struct PersonOptions {
  std::string sensor, robot_file, runtime_dir;
  std::vector<double> values;
  double lasting_s = 1;
};

std::unexpected<Refusal> refusal(int exit_code, std::string sentence) {
  return std::unexpected(Refusal{exit_code, std::move(sentence)});
}

// The entry of the robot file that this is a command of, and its limits.
std::expected<config::Sensor, Refusal> sensor_of(const config::RobotConfig& robot, const PersonOptions& options) {
  const auto sensor = command_sensor(robot, options.sensor);
  if (!sensor) return sensor;
  if (options.values.size() != sensor->values)
    return refusal(kExitUsage, fmt::format("{} has {} values ({}), this is {}: say them all", sensor->name,
                                           sensor->values, sensor->unit, options.values.size()));
  for (std::size_t i = 0; i < options.values.size(); ++i) {
    const double low = sensor->command->minimum[i], high = sensor->command->maximum[i];
    if (!(options.values[i] >= low && options.values[i] <= high))
      return refusal(kExitUsage,
                     fmt::format("value {} of {} is {}, outside [{}, {}] of {}: the policy host would drop it", i + 1,
                                 sensor->name, options.values[i], low, high, robot.file));
  }
  return *sensor;
}

void say(ipc::SensorServer& server, const PersonOptions& options, const config::Sensor& sensor) {
  SensorSample sample;
  sample.value_count = static_cast<std::uint32_t>(options.values.size());
  for (std::size_t i = 0; i < options.values.size(); ++i)
    sample.values[i] = sensors::float_within(options.values[i], sensor.command->minimum[i], sensor.command->maximum[i]);
  const MonoTime end = monotonic_now() + Duration{static_cast<std::int64_t>(options.lasting_s * 1e9)};
  const Duration interval = saying_interval(sensor.timeout);
  for (MonoTime next = monotonic_now(); next < end && !is_released(); next = next + interval) {
    ++sample.sequence;
    sample.sensed_at = sample.published_at = monotonic_now();
    server.publish(sample);
    sleep_until(std::min(next + interval, end));
  }
}

std::expected<void, Refusal> command(const PersonOptions& options) {
  const auto robot = config::load(options.robot_file);
  if (!robot) return refusal(config::kExitBadConfiguration, robot.error());
  const auto sensor = sensor_of(*robot, options);
  if (!sensor) return std::unexpected(sensor.error());
  const std::string directory =
      options.runtime_dir.empty() ? config::default_runtime_directory(robot->robot) : options.runtime_dir;
  const auto server = ipc::SensorServer::start(config::sensor_socket(directory, sensor->name));
  if (!server) return refusal(kExitUnavailable, server.error());
  release_on_signals();
  say(**server, options, *sensor);
  return {};
}

}  // namespace

void add_person_command(CLI::App& app, int& exit_code) {
  CLI::App* added =
      app.add_subcommand("command", "Tell a running robot's policy what you want, through one of its command sensors.");
  auto options = std::make_shared<PersonOptions>();
  added->add_option("sensor", options->sensor, "name of an entry in the robot file's sensors that has `command`")
      ->required();
  added->add_option("values", options->values, "one number per value, in the sensor's unit")
      ->required()
      ->expected(1, 64);
  added->add_option("--robot", options->robot_file, "robot file")->required();
  added->add_option("--runtime-dir", options->runtime_dir, "the robot's runtime directory");
  add_quantity(*added, "--for", options->lasting_s, "s", "how long it is said; Ctrl-C ends it before");
  added->footer(
      "Example: takt command wish 0.5 0 0 --for 2s --robot g1.yaml\n"
      "Afterwards what the robot file calls when_absent holds, once the sensor's timeout is over.\n"
      "Exit codes: 0 said, 64 command line (also a value outside its limits), 65 configuration, 69 another process "
      "commands.");
  added->callback([options, &exit_code] {
    const auto done = command(*options);
    if (!done) fmt::print(stderr, "takt command: {}\n", done.error().sentence);
    exit_code = done ? kExitOk : done.error().exit_code;
  });
}

}  // namespace takt::cli
