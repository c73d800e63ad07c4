// SPDX-License-Identifier: Apache-2.0
#include "cli/robot/command_sensor.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <vector>

#include "config/load.hpp"

namespace takt::cli {
namespace {

std::atomic<bool> g_released = false;
static_assert(std::atomic<bool>::is_always_lock_free);

}  // namespace

std::expected<config::Sensor, Refusal> command_sensor(const config::RobotConfig& robot, const std::string& name) {
  const auto sensor = std::ranges::find(robot.sensors, name, &config::Sensor::name);
  if (sensor != robot.sensors.end() && sensor->command) return *sensor;
  std::vector<std::string> known;
  for (const config::Sensor& each : robot.sensors)
    if (each.command) known.push_back(each.name);
  return std::unexpected(
      Refusal{config::kExitBadConfiguration,
              fmt::format("{}: `sensors` lists no command '{}' (there is {}); add it with `command: {{ minimum, "
                          "maximum, when_absent }}`, or correct the name",
                          robot.file, name, known.empty() ? "none" : fmt::format("{}", fmt::join(known, ", ")))});
}

Duration saying_interval(Duration timeout) {
  constexpr std::int64_t kSamplesPerTimeout = 4;
  return std::min(Duration{timeout.ns / kSamplesPerTimeout}, milliseconds(10));
}

void release_on_signals() {
  g_released = false;
  struct sigaction action {};
  action.sa_handler = [](int) { g_released = true; };
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
}

bool is_released() {
  return g_released;
}

}  // namespace takt::cli
