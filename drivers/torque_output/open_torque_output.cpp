// SPDX-License-Identifier: Apache-2.0
#include "drivers/torque_output/gpio_line.hpp"
#include "drivers/torque_output/locked_file.hpp"
#include "drivers/torque_output/torque_output.hpp"

namespace takt::drivers {

std::expected<OpenedTorqueOutput, std::string> open_torque_output(const config::SafeTorqueOff& wanted) {
  switch (wanted.output) {
    case config::TorqueOutputKind::gpio:
      return open_gpio_line(wanted);
    case config::TorqueOutputKind::file:
      return open_locked_file(wanted);
  }
  return open_gpio_line(wanted);
}

}  // namespace takt::drivers
