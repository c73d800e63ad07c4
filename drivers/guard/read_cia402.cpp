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

// A time of at most a second, after which the drive gives up by itself.
bool is_deadline(std::uint32_t ms) noexcept {
  return ms >= 1 && ms <= 1000;
}

// Motor side. Where the drive closes its own loop, this is the joint's limit; elsewhere frames keep that.
float most_torque(const JointFacts& facts) noexcept {
  const float joint_limit = facts.torque / std::abs(facts.ratio);
  const bool own_loop = facts.mode != config::Cia402Mode::cst && facts.torque > 0;
  return own_loop ? std::min(facts.torque_range, joint_limit) : facts.torque_range;
}

// Process data, heartbeat, mode, period and watchdog; no torque beyond the drive's range; nothing that scales or
// stores.
bool is_known_setting(const JointFacts& facts, std::uint32_t index, std::uint32_t sub, std::uint32_t value) noexcept {
  constexpr std::array<std::uint32_t, 9> kProcessData{0x1400, 0x1800, 0x1801, 0x1802, 0x1803,
                                                      0x1A00, 0x1017, 0x60C2, 0x1600};
  const ModeOnTheWire expected = on_the_wire(facts.mode);
  if (index == 0x6060) return value == expected.mode;
  if (index == 0x6007) return value == 1;
  if (index == 0x1016) return value >> 16 == kHost && is_deadline(value & 0xFFFF);
  if (index == 0x6072) return static_cast<float>(value) * facts.torque_per_mille <= most_torque(facts) * 1.0001F;
  const std::array<std::uint32_t, 3> map{0x6040'0010, 0x6060'0008, expected.target_map};
  if (index == 0x1600 && sub != 0) return sub <= map.size() && value == map[sub - 1];
  return std::ranges::find(kProcessData, index) != kProcessData.end();
}

Demand read_sdo(const JointFacts& facts, const CanFrame& frame) noexcept {
  const std::uint8_t command = frame.data[0];
  if (frame.length != 8) return {};
  // Reading: an object, its next segment, and the end of that.
  if (command == 0x40 || command == 0x60 || command == 0x70 || command == 0x80) return of_kind(Demand::Kind::aside);
  const bool writes = command == 0x23 || command == 0x27 || command == 0x2B || command == 0x2F;
  const bool known =
      writes && is_known_setting(facts, little16(frame.data + 1), frame.data[3], little32(frame.data + 4));
  return of_kind(known ? Demand::Kind::configure : Demand::Kind::unknown);
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
