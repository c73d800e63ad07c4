// SPDX-License-Identifier: Apache-2.0
// Listens to an MTi until a signal comes (the answer is empty) or there is nothing to hear (why, one sentence): not
// every system says that a port or an adapter vanished, so after a second of silence it is opened anew.
// Thread rule: one thread, which takes the signals while it waits, and at no other time.
#pragma once

#include <atomic>
#include <csignal>
#include <cstdint>
#include <string>

#include "config/robot_config.hpp"
#include "sensors/imu/imu_feed.hpp"
#include "sensors/imu/mti_can.hpp"

namespace takt::sensors {

struct Signals {
  const std::atomic<bool>& stop;
  sigset_t while_waiting;  // mask
};

// `baud`: a known one (serial_port.hpp).
std::string listen_serial(const std::string& port, std::uint32_t baud, ImuSeat& seat, const Signals& signals);

// `bus`: one of the robot file's; where its interface is missing, what its when_missing says.
std::string listen_can(const config::Bus& bus, const std::string& runtime_directory, const MtCanIds& ids, ImuSeat& seat,
                       const Signals& signals);

}  // namespace takt::sensors
