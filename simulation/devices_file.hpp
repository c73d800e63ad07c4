// SPDX-License-Identifier: Apache-2.0
// Drives without a robot: a file that lists buses and devices, read as strictly as a robot file.
//
//   schema: takt.devices/1
//   buses: [...]                    as in a robot file
//   devices:
//     - { name: knee, bus: can0, drive: {...}, inertia: 0.01 kgm2, position: 0 rad }
//   simulation: {...}               as in a robot file, without camera and target; may be left out
//
// Every key: docs/plant-scenarios.md.
#pragma once

#include <expected>
#include <string>
#include <string_view>

#include "config/robot_config.hpp"

namespace takt::simulation {

// A robot of which only buses, simulation and of each joint name, bus, drive, inertia, home (where the device starts)
// and limits.torque (what its brake holds: the drive's own torque) are filled in. All problems found, one per line.
std::expected<config::RobotConfig, std::string> load_devices(const std::string& path);
std::expected<config::RobotConfig, std::string> parse_devices(std::string_view text,
                                                              const std::string& name_for_messages);

}  // namespace takt::simulation
