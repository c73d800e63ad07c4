// SPDX-License-Identifier: Apache-2.0
// What the kernel says of a CAN interface: bit timing as it was set, state and error counters of its controller.
//
// Source: linux/can/netlink.h, rtnetlink(7). Thread rule: any but the control thread; a system call or three.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "config/robot_config.hpp"

namespace takt::drivers {

struct CanLink {
  bool exists = false;
  std::string kind;         // the kernel's word: "can", "vcan"; empty: none, as of slcan before Linux 6.0
  bool is_virtual = false;  // not "can": no bit timing, no counters
  bool up = false;
  std::string controller_state;  // "ERROR-ACTIVE", "ERROR-PASSIVE", "BUS-OFF", ... as ip-link(8) prints it
  // Of the arbitration phase and, for FD, of the data phase; 0: the kernel does not know (slcan, set over its line).
  std::uint32_t bitrate = 0, data_bitrate = 0;     // bit/s
  double sample_point = 0, data_sample_point = 0;  // share of a bit
  std::uint32_t sjw = 0, data_sjw = 0;             // time quanta
  bool fd = false;
  std::uint32_t restart_ms = 0;    // from bus-off to the restart; 0: it stays off until it is brought up anew
  std::uint32_t queue_length = 0;  // frames
  // The controller's error counters, 0 to 255 and beyond; nothing where its driver does not tell them.
  std::optional<std::uint32_t> transmit_errors, receive_errors;
  // How often since the driver was loaded.
  std::uint32_t bus_errors = 0, went_passive = 0, went_off = 0, restarts = 0;
};

// `exists` is false where there is no such interface, or the kernel cannot be asked.
CanLink read_can_link(const std::string& interface);

// Where the controller's bit rates, or the sample points and jump widths that the robot file gives, are others than the
// robot file's: "500000 bit/s, the robot file says 1000000 bit/s". Empty: nowhere, or the kernel
// knows of no bit timing.
std::string wrong_timing(const config::Bus& bus, const CanLink& link);

// Out of the kernel's answer to RTM_GETLINK. What is cut off or unknown is left out.
CanLink can_link_of(std::span<const std::byte> answer);

}  // namespace takt::drivers
