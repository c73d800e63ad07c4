// SPDX-License-Identifier: Apache-2.0
// Sources: CANopenNode/CANopenNode 301/CO_NMT_Heartbeat.h, CO_SDOserver.h (ids, NMT, SDO); the CiA 402 object numbers:
// 6040 controlword, 6060 mode, 607A, 60FF, 6071 targets.
#include <algorithm>
#include <array>
#include <cmath>

#include "drivers/guard/decoders.hpp"
#include "drivers/guard/wire_bytes.hpp"

namespace takt::drivers::guard {
namespace {

constexpr std::uint32_t kHost = 127;  // our own number on the bus

struct ModeOnTheWire {
  std::uint8_t mode;
  std::uint8_t length;  // of the RPDO
  std::uint32_t target_map;
};

ModeOnTheWire on_the_wire(config::Cia402Mode mode) noexcept {
  switch (mode) {
    case config::Cia402Mode::csp:
      return {8, 7, 0x607A'0020};
    case config::Cia402Mode::csv:
      return {9, 7, 0x60FF'0020};
    case config::Cia402Mode::cst:
      return {10, 5, 0x6071'0010};
  }
  return {10, 5, 0x6071'0010};
}

Motion target_of(const JointFacts& facts, const std::uint8_t* at) noexcept {
  const auto wide = static_cast<std::int32_t>(little32(at));
  switch (facts.mode) {
    case config::Cia402Mode::cst: {
      const auto per_mille = static_cast<std::int16_t>(little16(at));
      return {.tau = static_cast<float>(per_mille) * facts.torque_per_mille * facts.ratio};
    }
    case config::Cia402Mode::csv:
      return {.dq = static_cast<float>(wide * facts.rad_s_per_count) / facts.ratio};
    case config::Cia402Mode::csp:
      return {.q = static_cast<float>(wide * facts.rad_per_count / facts.ratio) + facts.offset};
  }
  return {};
}

Demand read_rpdo(const JointFacts& facts, const CanFrame& frame) noexcept {
  const ModeOnTheWire expected = on_the_wire(facts.mode);
  if (frame.length != expected.length || frame.data[2] != expected.mode) return {};
  switch (little16(frame.data)) {
    case 0x00:  // disable voltage
    case 0x80:  // fault reset
      return of_kind(Demand::Kind::disable);
    case 0x06:  // shutdown, switch on: the target counts once operation is enabled
    case 0x07:
      return of_kind(Demand::Kind::energise);
    case 0x0F:
      return {.kind = Demand::Kind::drive, .motion = target_of(facts, frame.data + 3)};
    default:
      return {};
  }
}

// Motor side. Where the drive closes its own loop, this is the joint's limit; elsewhere frames keep that.
float most_torque(const JointFacts& facts) noexcept {
  const float joint_limit = facts.torque / std::abs(facts.ratio);
  const bool own_loop = facts.mode != config::Cia402Mode::cst && facts.torque > 0;
  return own_loop ? std::min(facts.torque_range, joint_limit) : facts.torque_range;
}

// What a row's value depends on.
enum class Of : std::uint8_t {
  fixed,
  node,
  mode,
  target_map,
  period,
  period_exponent,
  largest_torque,
  following_window,
  following_timeout
};

// One object that set-up writes: where it is, how many bytes it has, and the only value that it may get; `of` other
// than fixed adds what the joint says, or is it.
struct Setting {
  std::uint16_t index;
  std::uint8_t sub, bytes;
  std::uint32_t value;
  Of of = Of::fixed;
};

constexpr std::uint32_t kOff = 0x8000'0000, kNoRemote = 0x4000'0000;  // of a PDO's COB-ID
constexpr std::uint32_t kDeadline_ms = 50;                            // after which the drive gives up by itself
constexpr std::uint32_t kItsHeartbeat_ms = 100;

// Nothing that scales, stores, or listens to another node. All of it is for a joint that is to be off.
constexpr Setting kSettings[] = {
    {0x1400, 1, 4, kOff + 0x200, Of::node},  // what commands the drive: off, ...
    {0x1400, 1, 4, 0x200, Of::node},         // ... and ours
    {0x1400, 2, 1, 1},                       // at every SYNC
    {0x1400, 5, 2, kDeadline_ms},
    {0x1600, 0, 1, 0},
    {0x1600, 0, 1, 3},
    {0x1600, 1, 4, 0x6040'0010},
    {0x1600, 2, 4, 0x6060'0008},
    {0x1600, 3, 4, 0, Of::target_map},
    {0x1800, 1, 4, kOff + kNoRemote + 0x180, Of::node},  // what it reports
    {0x1800, 1, 4, kNoRemote + 0x180, Of::node},
    {0x1800, 2, 1, 1},
    {0x1A00, 0, 1, 0},
    {0x1A00, 0, 1, 3},
    {0x1A00, 1, 4, 0x6041'0010},
    {0x1A00, 2, 4, 0x6064'0020},
    {0x1A00, 3, 4, 0x6077'0010},
    {0x1801, 1, 4, kOff + kNoRemote + 0x280, Of::node},
    {0x1802, 1, 4, kOff + kNoRemote + 0x380, Of::node},
    {0x1803, 1, 4, kOff + kNoRemote + 0x480, Of::node},
    {0x1016, 1, 4, kHost << 16U | kDeadline_ms},  // our heartbeat
    {0x1017, 0, 2, kItsHeartbeat_ms},
    {0x6007, 0, 2, 1},  // the loss of ours is a fault
    {0x6060, 0, 1, 0, Of::mode},
    {0x60C2, 1, 1, 0, Of::period},
    {0x60C2, 2, 1, 0, Of::period_exponent},
    {0x6072, 0, 2, 0, Of::largest_torque},
    {0x6065, 0, 4, 0, Of::following_window},
    {0x6066, 0, 2, 0, Of::following_timeout},
};

bool may_be(const Setting& row, const JointFacts& facts, std::uint32_t value) noexcept {
  switch (row.of) {
    case Of::fixed:
      return value == row.value;
    case Of::node:
      return value == row.value + facts.id;
    case Of::mode:
      return value == on_the_wire(facts.mode).mode;
    case Of::target_map:
      return value == on_the_wire(facts.mode).target_map;
    case Of::period:
      return facts.interpolation_value != 0 && value == facts.interpolation_value;
    case Of::period_exponent:
      return facts.interpolation_value != 0 && value == facts.interpolation_exponent;
    case Of::largest_torque:  // no more than it; 0 is none
      return value > 0 && static_cast<float>(value) * facts.torque_per_mille <= most_torque(facts) * 1.0001F;
    case Of::following_window:  // no drive is let run further from its target than the robot file allows
      return value > 0 && facts.following_window > 0 &&
             value * facts.rad_per_count <= facts.following_window * 1.0001 + facts.rad_per_count;
    case Of::following_timeout:
      return value > 0 && facts.following_window > 0 && value <= facts.following_timeout_ms;
  }
  return false;
}

bool is_known_setting(const JointFacts& facts, const std::uint8_t* sdo) noexcept {
  constexpr std::array<std::uint8_t, 5> kCommands{0, 0x2F, 0x2B, 0x27, 0x23};  // by the number of bytes
  const std::uint32_t index = little16(sdo + 1), value = little32(sdo + 4);
  return std::ranges::any_of(kSettings, [&](const Setting& row) {
    return row.index == index && row.sub == sdo[3] && kCommands[row.bytes] == sdo[0] && may_be(row, facts, value);
  });
}

Demand read_sdo(const JointFacts& facts, const CanFrame& frame) noexcept {
  const std::uint8_t command = frame.data[0];
  if (frame.length != 8) return {};
  // Reading: an object, its next segment, and the end of that.
  if (command == 0x40 || command == 0x60 || command == 0x70 || command == 0x80) return of_kind(Demand::Kind::aside);
  return of_kind(is_known_setting(facts, frame.data) ? Demand::Kind::configure : Demand::Kind::unknown);
}

Demand read_nmt(const JointFacts& facts, const CanFrame& frame) noexcept {
  constexpr std::uint8_t kStart = 1, kPreOperational = 128;
  const bool ours =
      frame.length == 2 && frame.data[1] == facts.id && (frame.data[0] == kStart || frame.data[0] == kPreOperational);
  return of_kind(ours ? Demand::Kind::configure : Demand::Kind::unknown);
}

}  // namespace

Demand read_cia402(const JointFacts& facts, const CanFrame& frame) noexcept {
  if (!is_classic(frame, false, frame.length)) return {};
  if (frame.id == 0x200 + facts.id) return read_rpdo(facts, frame);
  if (frame.id == 0x080) return of_kind(frame.length == 0 ? Demand::Kind::aside : Demand::Kind::unknown);
  if (frame.id == 0x600 + facts.id) return read_sdo(facts, frame);
  if (frame.id == 0x700 + kHost) return of_kind(frame.length == 1 ? Demand::Kind::aside : Demand::Kind::unknown);
  return frame.id == 0 ? read_nmt(facts, frame) : Demand{};
}

}  // namespace takt::drivers::guard
