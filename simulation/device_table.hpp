// SPDX-License-Identifier: Apache-2.0
// Which class plays which protocol's drive. Adding a protocol: drivers/protocol/README.md.
#pragma once

#include <memory>

#include "config/robot_config.hpp"
#include "simulation/device.hpp"

namespace takt::simulation {

// `watchdog`: without a command for this long an enabled drive is lost. Null: no device plays this protocol.
std::unique_ptr<Device> make_device(const config::Drive& drive, Duration watchdog);

}  // namespace takt::simulation
