// Frames of a CiA 402 drive for tests, written by hand: nothing here uses the codec.
#pragma once

#include <cstdint>
#include <cstdio>
#include <initializer_list>
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

// What a drive that agrees with everything answers: device type 402, the deadline, the given rated torque, else
// "written".
inline CanFrame agreeing_answer(const CanFrame& request, std::uint32_t rated_torque_mNm) {
  if (request.data[0] != 0x40) return sdo_answer(request, 0x60);
  const bool device_type = request.data[2] == 0x10;
  if (request.data[2] == 0x14) return sdo_answer(request, 0x4B, 50);  // 1400:05, ms
  return sdo_answer(request, 0x43, device_type ? 0x00020192 : rated_torque_mNm);
}

inline CanFrame tpdo(std::uint32_t node, std::uint32_t statusword, std::uint32_t position = 0,
                     std::uint32_t torque = 0) {
  return frame(0x180 + node, {statusword & 0xFFU, statusword >> 8U, position & 0xFFU, position >> 8U & 0xFFU,
                              position >> 16U & 0xFFU, position >> 24U, torque & 0xFFU, torque >> 8U & 0xFFU});
}

}  // namespace takt::drivers::test
