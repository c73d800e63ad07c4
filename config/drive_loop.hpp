// SPDX-License-Identifier: Apache-2.0
// Who closes a drive's control loop, and so what its setpoint must carry. A fact about protocols, known to all rooms.
#pragma once

#include <cstdint>

#include "config/robot_config.hpp"

namespace takt::config {

enum class LoopClosedBy : std::uint8_t {
  drive,          // the drive: position, velocity, gains and feed-forward torque go there
  host_torque,    // this computer: the drive takes a finished torque
  host_velocity,  // this computer: the drive takes a finished velocity
};

constexpr LoopClosedBy loop_closed_by(const Drive& drive) {
  switch (drive.protocol) {
    case DriveProtocol::mit:
    case DriveProtocol::robstride:
    case DriveProtocol::moteus:
      return LoopClosedBy::drive;
    case DriveProtocol::odrive:
      return LoopClosedBy::host_torque;
    case DriveProtocol::cia402:
      break;
  }
  switch (drive.mode) {
    case Cia402Mode::csp:
      return LoopClosedBy::drive;
    case Cia402Mode::csv:
      return LoopClosedBy::host_velocity;
    case Cia402Mode::cst:
      return LoopClosedBy::host_torque;
  }
  return LoopClosedBy::host_torque;
}

}  // namespace takt::config
