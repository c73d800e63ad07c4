// SPDX-License-Identifier: Apache-2.0
// Can a bus carry what its drives say every tick, in the fullest one where some are written to every few (drive.every)?
// Worst-case bits on the wire, stuffing included. Pure.
//
// What a drive says is told by its protocol's row (protocol_table.hpp). FD frames switch to the data bit rate; their
// data phase counts as the arbitration bits that would take as long.
//
// A classic data frame of n bytes has 47 + 8n bits (67 + 8n with a 29-bit id), inter-frame space included; the 34 + 8n
// (54 + 8n) bits from start of frame to checksum take a stuff bit after every four in the worst case: 111..135 bits for
// 8 bytes and an 11-bit id. An FD frame has 29 (48) bits at the arbitration rate and, at the data rate, 5 + 8n bits,
// then 4 + 17 (more than 16 bytes: 21) of stuff count and checksum with a fixed stuff bit before every four, and a
// delimiter. Source: ISO 11898-1.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <string>
#include <vector>

#include "config/robot_config.hpp"

namespace takt::drivers {

// Classic, 0..8 bytes.
std::uint32_t least_frame_bits(std::size_t bytes, bool extended);  // no stuff bits
std::uint32_t most_frame_bits(std::size_t bytes, bool extended);   // worst stuffing

// Worst stuffing, 0..64 bytes, with bit rate switch.
struct FdFrameBits {
  std::uint32_t arbitration = 0, data = 0;
};
FdFrameBits most_fd_frame_bits(std::size_t bytes, bool extended);

struct FrameTraffic;  // protocol_table.hpp
// How long such frames take per tick at worst stuffing, in bit times of the arbitration phase.
double bit_times(const FrameTraffic& frame, const config::Bus& bus);

// Above this share of the bit rate a late frame no longer finds its gap before the next tick.
inline constexpr double kMaxBusLoad = 0.9;

struct BusLoad {
  std::string bus;
  std::size_t drives = 0;
  std::uint32_t bits_per_tick = 0;  // worst case, commands and replies, of the fullest tick
  double load = 0;                  // share of the bit rate, 1 = all of it
  double undivided = 0;             // the same, were every drive written to in every tick (drive.every: 1)
};

// One entry per bus, or one sentence that shows the arithmetic of the first bus that is overloaded.
std::expected<std::vector<BusLoad>, std::string> check_bus_load(const config::RobotConfig& robot);

}  // namespace takt::drivers
