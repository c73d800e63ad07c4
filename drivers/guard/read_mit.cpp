// SPDX-License-Identifier: Apache-2.0
// Sources: bgkatz/motorcontrol Core/Src/can.c (unpack_cmd: p16 v12 kp12 kd12 t12, big-endian; seven FF and FC, FD, FE);
// enactic/openarm_can dm_motor_control.cpp (FB; registers on 7FF); the maker's manual of RS00, MIT protocol (six FF).
#include <algorithm>

#include "drivers/guard/decoders.hpp"
#include "drivers/guard/wire_bytes.hpp"

namespace takt::drivers::guard {
namespace {

constexpr std::uint32_t kRegisterId = 0x7FF;
constexpr std::uint8_t kReadRegister = 0x33, kWriteRegister = 0x55;
constexpr std::uint8_t kMitTimeout = 9;

// Questions; of orders only that for the drive's own time-out.
Demand read_register_frame(const JointFacts& facts, const CanFrame& frame) noexcept {
  const bool reads = frame.data[2] == kReadRegister;
  const bool sets_timeout =
      frame.data[2] == kWriteRegister && frame.data[3] == kMitTimeout && is_timeout(little32(frame.data + 4));
  const bool ours = little16(frame.data) == facts.id && (reads || sets_timeout);
  return of_kind(ours ? Demand::Kind::aside : Demand::Kind::unknown);
}

Demand read_special(const JointFacts& facts, std::uint8_t last) noexcept {
  switch (last) {
    case 0xFB:
      return of_kind(facts.damiao ? Demand::Kind::disable : Demand::Kind::unknown);
    case 0xFC:
      return of_kind(Demand::Kind::energise);
    case 0xFD:
      return of_kind(Demand::Kind::disable);
    default:  // FE moves the zero
      return {};
  }
}

}  // namespace

Demand read_mit(const JointFacts& facts, const CanFrame& frame) noexcept {
  if (facts.fd ? !is_fd(frame, 8) : !is_classic(frame, false, 8)) return {};
  if (facts.damiao && frame.id == kRegisterId) return read_register_frame(facts, frame);
  if (frame.id != facts.id) return {};
  const std::uint8_t* const b = frame.data;
  if (std::all_of(b, b + 6, [](std::uint8_t byte) { return byte == 0xFF; }))
    return b[6] == 0xFF ? read_special(facts, b[7]) : Demand{};  // a RobStride's mode, protocol or number
  constexpr float k16 = 65535, k12 = 4095;
  const std::uint32_t v = std::uint32_t{b[2]} << 4U | b[3] >> 4U;
  const std::uint32_t kp = (b[3] & 0xFU) << 8U | b[4];
  const std::uint32_t kd = std::uint32_t{b[5]} << 4U | b[6] >> 4U;
  const std::uint32_t t = (b[6] & 0xFU) << 8U | b[7];
  const Motion& range = facts.range;
  return {.kind = Demand::Kind::drive,
          .motion = to_joint(
              facts, {two_sided(share(big16(b), k16), range.q), two_sided(share(v, k12), range.dq),
                      share(kp, k12) * range.kp, share(kd, k12) * range.kd, two_sided(share(t, k12), range.tau)})};
}

}  // namespace takt::drivers::guard
