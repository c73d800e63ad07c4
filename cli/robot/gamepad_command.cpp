// SPDX-License-Identifier: Apache-2.0
// takt gamepad: operator input as one of the robot's sensors, by sticks, while a dead-man button is held.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cli/command.hpp"
#include "cli/quantity_option.hpp"
#include "cli/robot/command_sensor.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "sensors/gamepad/evdev.hpp"
#include "sensors/gamepad/gamepad.hpp"

namespace takt::cli {
namespace {

struct GamepadOptions {
  std::string sensor, device, robot_file, runtime_dir, dead_man = "tl";
  std::vector<std::string> sticks{"-y", "-x", "-rx"};
  double still_for_s = 0;  // 0: the sensor's timeout
};

std::unexpected<Refusal> refused(int exit_code, std::string sentence) {
  return std::unexpected(Refusal{exit_code, std::move(sentence)});
}

std::expected<sensors::GamepadMapping, Refusal> mapping_of(const config::Sensor& sensor,
                                                           const GamepadOptions& options) {
  if (options.sticks.size() < sensor.values)
    return refused(kExitUsage, fmt::format("{} has {} values ({}), --sticks names {}: name one for each", sensor.name,
                                           sensor.values, sensor.unit, options.sticks.size()));
  sensors::GamepadMapping mapping;
  for (std::size_t i = 0; i < sensor.values; ++i) {
    const auto stick = sensors::stick_named(options.sticks[i]);
    if (!stick)
      return refused(kExitUsage, fmt::format("--sticks: there is no {}; there are {}, and each with a minus sign",
                                             options.sticks[i], sensors::known_sticks()));
    mapping.sticks.push_back(*stick);
  }
  const auto button = sensors::button_named(options.dead_man);
  if (!button)
    return refused(kExitUsage,
                   fmt::format("--dead-man: there is no {}; there are {}", options.dead_man, sensors::known_buttons()));
  mapping.dead_man = *button;
  mapping.limits = *sensor.command;
  mapping.still_for = options.still_for_s > 0 ? Duration{std::llround(options.still_for_s * 1e9)} : sensor.timeout;
  return mapping;
}

// Says what holds: the person's wish, or what the robot file declares while there is none.
class Voice {
 public:
  Voice(ipc::SensorServer& server, const config::CommandLimits& limits) : server_(server), limits_(limits) {}

  void say(const std::optional<std::vector<float>>& wish, MonoTime now) {
    SensorSample sample;
    sample.sequence = ++said_;
    sample.sensed_at = sample.published_at = now;
    sample.value_count = static_cast<std::uint32_t>(limits_.when_absent.size());
    for (std::size_t i = 0; i < limits_.when_absent.size(); ++i)
      sample.values[i] =
          wish ? (*wish)[i] : sensors::float_within(limits_.when_absent[i], limits_.minimum[i], limits_.maximum[i]);
    server_.publish(sample);
  }

 private:
  ipc::SensorServer& server_;
  const config::CommandLimits& limits_;
  std::uint64_t said_ = 0;
};

// A hand that is taken for a pad that froze should know it.
class StillHand {
 public:
  void watch(bool held, bool believed, Duration still_for) {
    if (held && !believed && !said_)
      fmt::print(stderr,
                 "takt gamepad: the pad said nothing for {} ms while its button was held, so it is not believed until "
                 "it does: --still-for allows a stiller hand\n",
                 still_for.ns / milliseconds(1).ns);
    said_ = said_ || (held && !believed);
  }

 private:
  bool said_ = false;
};

std::expected<void, Refusal> relay(sensors::Evdev& device, sensors::Gamepad& pad, Voice& voice,
                                   const config::Sensor& sensor, Duration still_for) {
  const Duration interval = saying_interval(sensor.timeout);
  StillHand still;
  for (MonoTime next = monotonic_now(); !is_released();) {
    const Duration left = std::max(next - monotonic_now(), Duration{});
    const auto events = device.read(std::chrono::milliseconds(left.ns / milliseconds(1).ns + 1));
    const MonoTime now = monotonic_now();
    if (!events) return refused(kExitUnavailable, events.error());
    const bool was_held = pad.is_held();
    for (const input_event& event : *events) pad.take(event, now);
    if (now < next && pad.is_held() == was_held) continue;
    const auto wish = pad.wish(now);
    still.watch(pad.is_held(), wish.has_value(), still_for);
    voice.say(wish, now);
    next = now + interval;
  }
  return {};
}

std::expected<void, Refusal> gamepad(const GamepadOptions& options) {
  const auto robot = config::load(options.robot_file);
  if (!robot) return refused(config::kExitBadConfiguration, robot.error());
  const auto sensor = command_sensor(*robot, options.sensor);
  if (!sensor) return std::unexpected(sensor.error());
  auto mapping = mapping_of(*sensor, options);
  if (!mapping) return std::unexpected(mapping.error());
  auto device = sensors::Evdev::open(options.device, mapping->sticks, mapping->dead_man);
  if (!device) return refused(kExitUnavailable, device.error());
  const std::string directory =
      options.runtime_dir.empty() ? config::default_runtime_directory(robot->robot) : options.runtime_dir;
  const auto server = ipc::SensorServer::start(config::sensor_socket(directory, sensor->name));
  if (!server) return refused(kExitUnavailable, server.error());
  release_on_signals();
  const Duration still_for = mapping->still_for;
  sensors::Gamepad pad(std::move(*mapping));
  Voice voice(**server, *sensor->command);
  return relay(*device, pad, voice, *sensor, still_for);
}

}  // namespace

void add_gamepad(CLI::App& app, int& exit_code) {
  CLI::App* added = app.add_subcommand(
      "gamepad", "Tell a running robot's policy what you want with a gamepad, while you hold its dead-man button.");
  auto options = std::make_shared<GamepadOptions>();
  added->add_option("sensor", options->sensor, "name of an entry in the robot file's sensors that has `command`")
      ->required();
  added->add_option("--device", options->device, "the gamepad, one of /dev/input/by-id/*-event-joystick")->required();
  added->add_option("--robot", options->robot_file, "robot file")->required();
  added->add_option("--runtime-dir", options->runtime_dir, "the robot's runtime directory");
  added
      ->add_option("--sticks", options->sticks,
                   "one axis per value, with a minus sign reversed; default -y,-x,-rx: ahead, left, turn left")
      ->delimiter(',');
  added->add_option("--dead-man", options->dead_man, "button that has to be held; default tl, the left shoulder");
  add_quantity(*added, "--still-for", options->still_for_s, "s",
               "how long a held pad is believed that says nothing; 0: the sensor's timeout");
  added->footer(
      "Example: takt gamepad wish --robot g1.yaml --device /dev/input/by-id/usb-Pad-event-joystick\n"
      "While the button is not held, and once it has ended, what the robot file calls when_absent holds.\n"
      "Exit codes: 0 ended by a signal, 64 command line, 65 configuration, 69 no such gamepad, it was unplugged, or "
      "another process commands.");
  added->callback([options, &exit_code] {
    const auto done = gamepad(*options);
    if (!done) fmt::print(stderr, "takt gamepad: {}\n", done.error().sentence);
    exit_code = done ? kExitOk : done.error().exit_code;
  });
}

}  // namespace takt::cli
