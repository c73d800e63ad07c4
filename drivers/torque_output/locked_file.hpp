// SPDX-License-Identifier: Apache-2.0
// A file as torque output, for simulated robots and tests: a lock on its first byte is the permission. As with a line,
// the kernel takes it back when the process dies, however it dies; a query of it uses F_OFD_GETLK. A
// file that is removed meanwhile is an output that fails, and so is one whose lock another process holds.
#pragma once

#include <expected>
#include <string>

#include "drivers/torque_output/torque_output.hpp"

namespace takt::drivers {

// Makes the file where there is none.
std::expected<OpenedTorqueOutput, std::string> open_locked_file(const config::SafeTorqueOff& wanted);

// A process permits torque by the lock on this file. False where there is no such file.
bool is_torque_permitted(const std::string& file);

}  // namespace takt::drivers
