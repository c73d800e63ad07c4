// SPDX-License-Identifier: Apache-2.0
// A GPIO line as torque output, by libgpiod: requested as an output that does not permit torque, held until
// destruction.
#pragma once

#include <expected>
#include <string>

#include "drivers/torque_output/torque_output.hpp"

namespace takt::drivers {

std::expected<OpenedTorqueOutput, std::string> open_gpio_line(const config::SafeTorqueOff& wanted);

}  // namespace takt::drivers
