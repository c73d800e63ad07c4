// SPDX-License-Identifier: Apache-2.0
// What CiA 402 drives differ in, as far as a host has to care. The default is a drive with everything.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "config/robot_config.hpp"

namespace takt::simulation {

struct Cia402Profile {
  bool has_deadline = true;          // sub-index 5 of 1400
  bool has_heartbeat_watch = true;   // 1016 and 6007
  bool has_second_pdos = true;       // 1401, 1801
  bool has_max_torque = true;        // 6072
  bool has_following_window = true;  // 6065 and 6066
  bool shows_mode = true;            // 6061 goes with 6060
  bool follows = true;               // bit 12 while enabled
  // RPDO1 and TPDO1 cannot be mapped anew: as a host of Cia402Mode would have them, or with the control- and statusword
  // alone.
  enum class Map : std::uint8_t { free, fixed, fixed_words_only };
  Map map = Map::free;
  std::uint32_t modes = 0x380;                   // object 6502: csp, csv, cst
  double speed_counts = 0;                       // of 60FF and 606C at one turn per second; 0: position's counts
  std::optional<std::uint32_t> velocity_unit{};  // object 60A9; nothing: it is not there
  // Objects 608F (increments and turns), 6091 (motor and shaft), 6092 (units and turns of the shaft) and 60A8; nothing:
  // it is not there.
  using Ratio = std::array<std::uint32_t, 2>;
  std::optional<Ratio> encoder{}, gear{}, feed{};
  std::optional<std::uint32_t> position_unit{};
  // Object 1018: vendor, product, revision, serial number; how many of them there are.
  std::array<std::uint32_t, 4> identity{0x0000'0054, 0x0402'0001, 0x0001'0002, 7};
  std::uint8_t identity_entries = 4;
  std::string_view software = "takt-plant 1.4.2";  // object 100A; empty: it is not there
};

// A drive that is as the robot file says.
Cia402Profile profile_of(const config::Drive& drive);

}  // namespace takt::simulation
