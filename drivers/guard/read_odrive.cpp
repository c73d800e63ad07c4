// SPDX-License-Identifier: Apache-2.0
// Source: odriverobotics/ODriveArduino src/can_simple_messages.hpp (firmware 0.6): id = node << 5 | message.
#include "drivers/guard/decoders.hpp"
#include "drivers/guard/wire_bytes.hpp"

namespace takt::drivers::guard {
namespace {

// As a remote frame alone: what 00 and its data would mean is not documented.
bool is_version_question(const CanFrame& frame) noexcept {
  return (frame.id & 0x1FU) == 0 && !frame.extended && !frame.fd && !frame.error && frame.length == 0;
}

Demand read_axis_state(const CanFrame& frame) noexcept {
  constexpr std::uint32_t kIdle = 1, kClosedLoop = 8;
  if (frame.length != 4) return {};
  const std::uint32_t state = little32(frame.data);
  if (state == kIdle) return of_kind(Demand::Kind::disable);
  return of_kind(state == kClosedLoop ? Demand::Kind::energise : Demand::Kind::unknown);
}

Demand read_mode(const CanFrame& frame) noexcept {
  constexpr std::uint32_t kTorqueControl = 1, kPassThrough = 1;
  const bool ours =
      frame.length == 8 && little32(frame.data) == kTorqueControl && little32(frame.data + 4) == kPassThrough;
  return of_kind(ours ? Demand::Kind::aside : Demand::Kind::unknown);
}

Demand read_torque(const JointFacts& facts, const CanFrame& frame) noexcept {
  if (frame.length != 4) return {};
  return {.kind = Demand::Kind::drive, .motion = {.tau = little_float(frame.data) * facts.ratio}};
}

}  // namespace

Demand read_odrive(const JointFacts& facts, const CanFrame& frame) noexcept {
  if (frame.id >> 5U != facts.id) return {};
  if (frame.remote) return of_kind(is_version_question(frame) ? Demand::Kind::aside : Demand::Kind::unknown);
  if (!is_classic(frame, false, frame.length)) return {};
  switch (frame.id & 0x1FU) {
    case 0x02:  // emergency stop
    case 0x18:  // clear errors
      return of_kind(frame.length <= 1 ? Demand::Kind::disable : Demand::Kind::unknown);
    case 0x07:
      return read_axis_state(frame);
    case 0x0B:
      return read_mode(frame);
    case 0x0E:
      return read_torque(facts, frame);
    default:
      return {};
  }
}

}  // namespace takt::drivers::guard
