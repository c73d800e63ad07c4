// SPDX-License-Identifier: Apache-2.0
#include "simulation/device_table.hpp"

#include "simulation/cia402_device.hpp"
#include "simulation/mit_device.hpp"
#include "simulation/moteus_device.hpp"
#include "simulation/odrive_device.hpp"
#include "simulation/robstride_device.hpp"

namespace takt::simulation {

std::unique_ptr<Device> make_device(const config::Drive& drive, Duration watchdog) {
  switch (drive.protocol) {
    case config::DriveProtocol::mit:
      return std::make_unique<MitDevice>(drive, watchdog);
    case config::DriveProtocol::robstride:
      return std::make_unique<RobstrideDevice>(drive, watchdog);
    case config::DriveProtocol::odrive:
      return std::make_unique<OdriveDevice>(drive, watchdog);
    case config::DriveProtocol::moteus:
      return std::make_unique<MoteusDevice>(drive, watchdog);
    case config::DriveProtocol::cia402:
      return std::make_unique<Cia402Device>(drive, watchdog);
  }
  return nullptr;
}

}  // namespace takt::simulation
