// SPDX-License-Identifier: Apache-2.0
// Frames of a CiA 402 drive for tests, written by hand: nothing here uses the codec.
#pragma once

#include <cstdint>
#include <cstdio>
#include <initializer_list>
#include <map>
#include <string>

#include "drivers/bus/can_bus.hpp"

namespace takt::drivers::test {

// In can-utils' grammar: 123#DEADBEEF, in lower case.
inline std::string text(const CanFrame& frame) {
  char part[8];
  std::snprintf(part, sizeof part, "%03x#", frame.id);
  std::string out = part;
  for (int i = 0; i < frame.length; ++i) {
    std::snprintf(part, sizeof part, "%02x", frame.data[i]);
    out += part;
  }
  return out;
}

inline CanFrame frame(std::uint32_t id, std::initializer_list<std::uint32_t> bytes) {
  CanFrame made;
  made.id = id;
  for (const std::uint32_t byte : bytes) made.data[made.length++] = static_cast<std::uint8_t>(byte);
  return made;
}

// Answers to an SDO request, by repeating the object it names.
inline CanFrame sdo_answer(const CanFrame& request, std::uint32_t command, std::uint32_t value = 0) {
  return frame(request.id - 0x80, {command, request.data[1], request.data[2], request.data[3], value & 0xFFU,
                                   value >> 8U & 0xFFU, value >> 16U & 0xFFU, value >> 24U});
}

// A drive that agrees: it tells what was written to it, shows the mode that it was given, and has every mode.
class AgreeingDrive {
 public:
  explicit AgreeingDrive(std::uint32_t rated_torque_mNm) {
    values_[0x1000'00] = 0x00020192;
    values_[0x6076'00] = rated_torque_mNm;
    values_[0x6502'00] = 0x380;
    values_[0x60A9'00] = 0x00B50300;
  }
  CanFrame answer(const CanFrame& request) {
    const std::uint8_t* data = request.data;
    const std::uint32_t object = std::uint32_t{data[2]} << 16 | std::uint32_t{data[1]} << 8 | data[3];
    if (data[0] == 0x40) return sdo_answer(request, 0x43, values_[object == 0x6061'00 ? 0x6060'00 : object]);
    values_[object] =
        std::uint32_t{data[7]} << 24 | std::uint32_t{data[6]} << 16 | std::uint32_t{data[5]} << 8 | data[4];
    return sdo_answer(request, 0x60);
  }

 private:
  std::map<std::uint32_t, std::uint32_t> values_;  // by index << 8 | sub-index
};

inline CanFrame tpdo(std::uint32_t node, std::uint32_t statusword, std::uint32_t position = 0,
                     std::uint32_t torque = 0) {
  return frame(0x180 + node, {statusword & 0xFFU, statusword >> 8U, position & 0xFFU, position >> 8U & 0xFFU,
                              position >> 16U & 0xFFU, position >> 24U, torque & 0xFFU, torque >> 8U & 0xFFU});
}

}  // namespace takt::drivers::test
