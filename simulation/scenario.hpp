// SPDX-License-Identifier: Apache-2.0
// What goes wrong in a simulation, and when: a scenario file, read as strictly as a robot file.
//
//   schema: takt.scenario/1
//   events:
//     - { at: 2 s, joint: elbow, fault: silent, for: 200 ms }
//     - { after: enabled, at: 1 s, joint: elbow, error: over_temperature }
//
// Every key: docs/plant-scenarios.md. Errors: one line per problem, "file:line:column: what; how to correct it".
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"
#include "simulation/device.hpp"

namespace takt::simulation {

// fault             of      while it lasts
// error             joint   the drive found an error; stays until the host clears it, so it has no length
// power_cycle       joint   supply off; the drive boots when it ends
// silent            joint   obeys, is not heard
// deaf              joint   hears nothing
// repeat            joint   everything it says arrives twice
// delay             joint   everything it says arrives later
// drop              joint, bus, sensor: a share of what it says is lost; on a bus: of everything that crosses it
// foreign_commands  joint   a second host enables the drive and commands position zero without stiffness
// error_passive     bus     every controller is error passive
// bus_off           bus     every controller is off the bus
// down              bus     the bus is gone, for good
// babble            bus     a stranger fills the bus with frames that no node listens to
// frozen_position   joint   the position it says stays; the rest is true
// reversed          joint   the position it says goes the other way; the rest is true
// wrap              joint   the position it says is a turn off
// jump              joint   the position it says is off by an angle
// scale             joint   the position it says goes that much further
// freeze            joint, sensor  all that it says of its motion stays; samples repeat an old value: under fresh
// stamps burst             sensor  samples are held back and delivered together lies              sensor  a share of
// the samples says the opposite push              body    a force at the tool, or at a body of the model payload body
// a point mass at the tool, or at a body of the model friction          body    that many times the joints' friction
enum class FaultKind : std::uint8_t {
  error,
  power_cycle,
  silent,
  deaf,
  repeat,
  delay,
  drop,
  foreign_commands,
  error_passive,
  bus_off,
  down,
  babble,
  frozen_position,
  reversed,
  wrap,
  jump,
  scale,
  freeze,
  burst,
  lies,
  push,
  payload,
  friction
};

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
  Duration delay;                                     // delay; burst: its length
  double share = 0;                                   // drop, lies
  double amount = 0;                                  // push: N; payload: kg; friction, scale: factor; jump: rad
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
