// SPDX-License-Identifier: Apache-2.0
// What the drives and the buses report, decoded at the edge and handed to the tick as values.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <type_traits>

#include "executive/contract/layout.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/wire_verdict.hpp"

namespace takt {

enum class DriveState : std::uint8_t { unknown, disabled, enabled, fault };

struct JointFeedback {
  MonoTime received_at;          // kernel receive stamp of the newest reply; unset before the first
  float q = 0.0F;                // rad, joint side (direction, offset and gear applied)
  float dq = 0.0F;               // rad/s, as the drive reports it
  float tau = 0.0F;              // Nm, joint side
  float temperature_C = 0.0F;    // hottest part the drive reports; 0 when it reports none
  std::uint32_t error_code = 0;  // protocol's own code; 0 none
  DriveState drive_state = DriveState::unknown;
  std::uint8_t replies = 0;  // position reports decoded since start, modulo 256: how the tick tells lost from repeated
  // Not the drive's word but the last guard's, on what the previous tick was about to send it: set at the edge.
  WireVerdict refused = WireVerdict::allowed;
  // Of the casing or output stage, where the drive tells it apart from the winding: whole degrees Celsius, rounded up,
  // 1..255; 0: it does not.
  std::uint8_t casing_C = 0;
};
template <std::same_as<JointFeedback> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(received_at),   TAKT_FIELD(q),          TAKT_FIELD(dq),          TAKT_FIELD(tau),
      TAKT_FIELD(temperature_C), TAKT_FIELD(error_code), TAKT_FIELD(drive_state), TAKT_FIELD(replies),
      TAKT_FIELD(refused),       TAKT_FIELD(casing_C),
  };
}
static_assert(std::is_standard_layout_v<JointFeedback> && sizeof(JointFeedback) == 32);

// A reading as casing_C has it.
constexpr std::uint8_t whole_degrees(float celsius) {
  if (!(celsius > 1.0F)) return 1;  // NaN, too
  if (celsius >= 255.0F) return 255;
  const auto down = static_cast<std::uint8_t>(celsius);
  return static_cast<float>(down) < celsius ? static_cast<std::uint8_t>(down + 1) : down;
}

// What is wrong with a joint's replies: bits, one mask per joint. The first three: over about the last window
// (pipeline/bus_watch.hpp); the others: pipeline/joint_watch.hpp.
enum class ReplyFault : std::uint16_t {
  lost = 1U << 0U,
  repeated = 1U << 1U,
  delayed = 1U << 2U,
  outlier = 1U << 3U,       // the newest position is out of reach of the one before, and is not believed
  jumped = 1U << 4U,        // such positions one after the other
  contradicts = 1U << 5U,   // positions move otherwise than the drive's own velocity says
  frozen = 1U << 6U,        // the position stands still while the joint moves
  from_future = 1U << 7U,   // the newest stamp lies ahead of the tick; it is not believed
  moved_unheard = 1U << 8U  // after a silence it reads elsewhere than before; until a reset in standby
};
using ReplyFaultMask = std::uint16_t;
constexpr ReplyFaultMask bit(ReplyFault fault) {
  return static_cast<ReplyFaultMask>(fault);
}

enum class BusState : std::uint8_t { up, error_passive, bus_off, down };

struct BusHealth {
  std::uint32_t tx_dropped = 0;      // frames the kernel queue refused or the controller gave up, since start
  std::uint32_t rx_dropped = 0;      // frames lost on receive (SO_RXQ_OVFL, controller overflows), since start
  std::uint32_t foreign_frames = 0;  // frames on our drives' ids that are none of theirs, since start
  BusState state = BusState::up;
  std::uint8_t flooded = 0;  // 1: more frames arrived for this tick than our drives can say; set at the edge
  std::uint8_t reserved[2] = {};
  // Of our own frames, as the controller says that they are on the wire; both unset where it does not say.
  MonoTime left_at;        // when the newest one left
  MonoTime waiting_since;  // when the oldest one that has not left was handed over; unset: all have left
};
template <std::same_as<BusHealth> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(tx_dropped), TAKT_FIELD(rx_dropped), TAKT_FIELD(foreign_frames), TAKT_FIELD(state),
      TAKT_FIELD(flooded),    TAKT_FIELD(reserved),   TAKT_FIELD(left_at),        TAKT_FIELD(waiting_since),
  };
}
static_assert(std::is_standard_layout_v<BusHealth> && sizeof(BusHealth) == 32);

}  // namespace takt
