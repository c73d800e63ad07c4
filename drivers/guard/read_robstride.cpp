// SPDX-License-Identifier: Apache-2.0
// Source: belovictor/cybergear-docs instructionmanual.md, section 4: id = type 5 | data 16 | target 8; type 1 carries
// torque in the id and position, velocity, kp, kd as big-endian 16-bit codes; 3 enable, 4 stop, 17 read, 18 write.
#include "drivers/guard/decoders.hpp"
#include "drivers/guard/wire_bytes.hpp"

namespace takt::drivers::guard {
namespace {

constexpr std::uint32_t kRunMode = 0x7005, kRobstrideTimeout = 0x7028;

Demand read_motion(const JointFacts& facts, std::uint32_t torque, const std::uint8_t* b) noexcept {
  constexpr float k16 = 65535;
  const Motion& range = facts.range;
  return {.kind = Demand::Kind::drive,
          .motion = to_joint(facts, {two_sided(share(big16(b), k16), range.q),
                                     two_sided(share(big16(b + 2), k16), range.dq), share(big16(b + 4), k16) * range.kp,
                                     share(big16(b + 6), k16) * range.kd, two_sided(share(torque, k16), range.tau)})};
}

}  // namespace

Demand read_robstride(const JointFacts& facts, const CanFrame& frame) noexcept {
  if (!is_classic(frame, true, 8) || (frame.id & 0xFFU) != facts.id) return {};
  const std::uint32_t type = frame.id >> 24U & 0x1FU;
  const std::uint32_t data = frame.id >> 8U & 0xFFFFU;
  if (type == 1) return read_motion(facts, data, frame.data);
  if ((data & 0xFFU) != facts.host) return {};
  const bool sets_motion_mode = little16(frame.data) == kRunMode && little32(frame.data + 4) == 0;
  const bool sets_timeout = little16(frame.data) == kRobstrideTimeout && is_timeout(little32(frame.data + 4));
  switch (type) {
    case 0:  // who are you
      return of_kind(Demand::Kind::aside);
    case 3:
      return of_kind(Demand::Kind::energise);
    case 4:
      return of_kind(Demand::Kind::disable);
    case 17:
      return of_kind(Demand::Kind::aside);
    case 18:  // the mode that obeys motion commands, the drive's own time-out, and no other setting
      return of_kind(sets_motion_mode || sets_timeout ? Demand::Kind::aside : Demand::Kind::unknown);
    default:
      return {};
  }
}

}  // namespace takt::drivers::guard
