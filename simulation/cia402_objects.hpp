// SPDX-License-Identifier: Apache-2.0
// The object dictionary of a simulated CiA 402 drive: values, access rules, and the rules for configuring PDOs.
//
// What a write must keep to, else the abort code of CiA 301: the object exists (06020000, its sub-index 06090011), may
// be written (06010002), has that size (06070010) and range (06090030). PDOs besides: none of their objects in NMT
// state operational (08000022); no new id while the PDO exists; no mapping change while it exists, no entry change
// while the map counts entries (06010000); only mappable objects (06040041), eight bytes in all (06040042). TPDOs are
// not to be asked for with remote frames: bit 30 of their COB-ID must be set.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "simulation/cia402_profile.hpp"

namespace takt::simulation {

enum class SdoAbort : std::uint32_t {
  none = 0,
  unknown_command = 0x0504'0001,
  unsupported_access = 0x0601'0000,
  read_only = 0x0601'0002,
  no_such_object = 0x0602'0000,
  not_mappable = 0x0604'0041,
  map_too_long = 0x0604'0042,
  wrong_length = 0x0607'0010,
  no_such_sub_index = 0x0609'0011,
  out_of_range = 0x0609'0030,
  device_state = 0x0800'0022,
};

struct ObjectEntry {
  enum class Use : std::uint8_t { constant, setting, to_drive, from_drive };
  unsigned bytes = 0;
  std::uint32_t value = 0;
  Use use = Use::constant;
  [[nodiscard]] bool writable() const { return use == Use::setting || use == Use::to_drive; }
};

struct MappedObject {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  unsigned bytes = 0;
};

class Cia402Objects {
 public:
  // `deadline_ms`: what the drive has stored in 1400:05.
  Cia402Objects(const config::Drive& drive, std::uint16_t deadline_ms, const Cia402Profile& profile);

  // Values of power-on: of everything, or of 1000..1FFF only.
  void reset();
  void reset_communication();

  [[nodiscard]] SdoAbort why_not_readable(std::uint16_t index, std::uint8_t sub) const;
  // `bytes` 0: the client did not say how many.
  SdoAbort write(std::uint16_t index, std::uint8_t sub, std::uint32_t value, unsigned bytes, bool operational);

  // From inside the drive: no rules but that the object exists.
  [[nodiscard]] bool has(std::uint16_t index, std::uint8_t sub = 0) const;
  [[nodiscard]] const ObjectEntry& at(std::uint16_t index, std::uint8_t sub = 0) const;
  [[nodiscard]] std::uint32_t value(std::uint16_t index, std::uint8_t sub = 0) const { return at(index, sub).value; }
  void set(std::uint16_t index, std::uint32_t value) { set(index, 0, value); }
  void set(std::uint16_t index, std::uint8_t sub, std::uint32_t value);

  // `communication`: 1400 or 1800 and so on.
  [[nodiscard]] bool pdo_exists(std::uint16_t communication) const;
  [[nodiscard]] std::uint32_t pdo_id(std::uint16_t communication) const;
  [[nodiscard]] std::vector<MappedObject> pdo_map(std::uint16_t communication) const;

 private:
  [[nodiscard]] SdoAbort check(std::uint16_t index, std::uint8_t sub, std::uint32_t value) const;
  [[nodiscard]] SdoAbort check_cob_id(std::uint16_t index, std::uint32_t value) const;
  [[nodiscard]] SdoAbort check_map(std::uint16_t index, std::uint8_t sub, std::uint32_t value) const;
  [[nodiscard]] SdoAbort check_entry(std::uint16_t index, std::uint32_t mapping) const;
  [[nodiscard]] SdoAbort check_count(std::uint16_t index, std::uint32_t count) const;

  using Entries = std::map<std::uint32_t, ObjectEntry>;  // by index << 8 | sub-index
  void fix_maps(const config::Drive& drive, const Cia402Profile& profile);
  Entries power_on_, entries_;
};

}  // namespace takt::simulation
