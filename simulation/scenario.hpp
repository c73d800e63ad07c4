// SPDX-License-Identifier: Apache-2.0
// What goes wrong in a simulation, and when: a scenario file, read as strictly as a robot file.
//
//   schema: takt.scenario/1
//   events:
//     - { at: 2 s, joint: elbow, fault: silent, for: 200 ms }
//     - { after: enabled, at: 1 s, joint: elbow, error: over_temperature }
//
// The faults and their doses: config/trouble/kinds.hpp. Every key: docs/plant-scenarios.md. Errors: one line per
// problem, "file:line:column: what; how to correct it".
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/robot_config.hpp"
#include "config/trouble/kinds.hpp"
#include "executive/contract/mono_time.hpp"
#include "simulation/device.hpp"

namespace takt::simulation {

using trouble::FaultKind;

// What an event strikes. The body is the robot's mechanics; an event names none of the others then.
enum class Target : std::uint8_t { joint, bus, sensor, body };

struct FaultEvent {
  Duration at;                    // since the beginning
  bool after_enabled = false;     // since the drive (bus, sensor, body: the last of its drives) was first enabled
  std::optional<Duration> lasts;  // none: to the end
  Target strikes = Target::joint;
  std::size_t target = 0;  // joint, bus or sensor
  std::string target_name;
  FaultKind kind = FaultKind::error;
  DeviceFault error = DeviceFault::over_temperature;  // error
  double dose = 0;                                    // in base units: ns, rad, N, kg, or as counted
  config::Vector3 along{};                            // push: where to, base frame, length 1
  std::string body{};                                 // push, payload: which; empty: the tool, or the root
};

struct Scenario {
  std::vector<FaultEvent> events;  // in file order
};

// For the joints, buses and sensors of `robot`.
std::expected<Scenario, std::string> load_scenario(const std::string& path, const config::RobotConfig& robot);
std::expected<Scenario, std::string> parse_scenario(std::string_view text, const std::string& name_for_messages,
                                                    const config::RobotConfig& robot);

// "silent for 200 ms", "over_temperature", "delay of 3 ms": for logs.
std::string text_of(const FaultEvent& event);

}  // namespace takt::simulation
