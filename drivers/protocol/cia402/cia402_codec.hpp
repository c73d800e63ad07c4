// SPDX-License-Identifier: Apache-2.0
// CANopen (CiA 301) and its drive profile (CiA 402), host side: frames to bytes and back. Pure.
//
// 11-bit ids, n = node number 1..127, little-endian payloads: NMT 000, SYNC 080, EMCY 080+n, TPDO1 180+n, RPDO1 200+n,
// SDO answer 580+n, SDO request 600+n, heartbeat 700+n. SDO: expedited transfers only (1..4 bytes).
//
// The process data, the same in every drive of a mode, 7 or 5 bytes out and 8 bytes back:
//   CSP  RPDO1 controlword 6040, mode 6060, target position 607A i32   TPDO1 statusword 6041,
//   CSV  RPDO1 controlword 6040, mode 6060, target velocity 60FF i32         position 6064 i32,
//   CST  RPDO1 controlword 6040, mode 6060, target torque 6071 i16           torque 6077 i16
// Every mode reports position and torque; velocity (606C) would not fit beside them, and a second frame would cost the
// bus its third drive: a part that needs velocity differentiates position.
// Units on the wire: counts, counts/s, per mille of rated torque. Sources: CANopenNode/CANopenNode
// 301/CO_NMT_Heartbeat.h, CO_SDOserver.h; ros-industrial/ros2_canopen canopen_402_driver state.cpp, command.cpp.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "config/robot_config.hpp"
#include "drivers/bus/can_bus.hpp"

namespace takt::drivers::cia402 {

inline constexpr std::uint32_t kNmtId = 0x000, kSyncId = 0x080, kEmergencyId = 0x080, kTpdo1Id = 0x180,
                               kRpdo1Id = 0x200, kTpdo2Id = 0x280, kTpdo3Id = 0x380, kTpdo4Id = 0x480,
                               kSdoAnswerId = 0x580, kSdoRequestId = 0x600, kHeartbeatId = 0x700;

enum class NmtCommand : std::uint8_t {
  start = 1,
  stop = 2,
  pre_operational = 128,
  reset_node = 129,
  reset_communication = 130
};
CanFrame encode_nmt(NmtCommand command, std::uint32_t node) noexcept;
CanFrame encode_sync() noexcept;

// This computer's own number, which no drive has.
inline constexpr std::uint32_t kHostNode = 127;
// That this computer lives, for drives that watch it: NMT state operational.
CanFrame encode_our_heartbeat() noexcept;

enum class NmtState : std::uint8_t { boot = 0, stopped = 4, operational = 5, pre_operational = 127 };
// Nothing for another length or a state that CiA 301 does not know.
std::optional<NmtState> decode_heartbeat(const CanFrame& frame) noexcept;

struct Emergency {
  std::uint16_t code = 0;  // 0: the drive's errors are gone
  std::uint8_t error_register = 0;
};
std::optional<Emergency> decode_emergency(const CanFrame& frame) noexcept;

struct ObjectId {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  friend constexpr bool operator==(ObjectId, ObjectId) = default;
};
// `bytes`: 1..4, the object's size in the drive.
CanFrame encode_sdo_write(std::uint32_t node, ObjectId object, std::uint32_t value, unsigned bytes) noexcept;
CanFrame encode_sdo_read(std::uint32_t node, ObjectId object) noexcept;

struct SdoAnswer {
  // segmented: what was asked for does not fit into an answer, and is to be fetched segment by segment.
  enum class Kind : std::uint8_t { written, value, segmented, aborted };
  Kind kind = Kind::written;
  ObjectId object;
  std::uint32_t value = 0;  // kind value: zero-extended; kind aborted: the CiA 301 abort code
  // False: the drive did not say how many of the four bytes count (command 42), and the rest may be anything.
  bool is_sized = true;
};
// Nothing for segments, and for block transfers, which were not requested.
std::optional<SdoAnswer> decode_sdo_answer(const CanFrame& frame) noexcept;

// Of an object that did not fit: `toggle` alternates from one to the next, and is false of the first.
struct SdoSegment {
  bool toggle = false, last = false;
  std::array<std::uint8_t, 7> bytes{};  // zero from `length` on
  std::size_t length = 0;
};
CanFrame encode_sdo_segment_request(std::uint32_t node, bool toggle) noexcept;
// Nothing: no segment of an upload. An SDO segment does not say whose it is.
std::optional<SdoSegment> decode_sdo_segment(const CanFrame& frame) noexcept;
// Ends a transfer that goes on.
CanFrame encode_sdo_abort(std::uint32_t node, ObjectId object) noexcept;

inline constexpr std::uint32_t kAbortNoSuchObject = 0x0602'0000, kAbortNoSuchSubIndex = 0x0609'0011;

// One mapped object in PDO mapping objects: index 16 | sub 8 | bits 8.
using PdoMap = std::array<std::uint32_t, 3>;
const PdoMap& rpdo_map(config::Cia402Mode mode) noexcept;
inline constexpr PdoMap kTpdoMap{0x6041'0010, 0x6064'0020, 0x6077'0010};
std::size_t rpdo_bytes(config::Cia402Mode mode) noexcept;
inline constexpr std::size_t kTpdoBytes = 8;

// Value of object 6060.
std::uint8_t mode_of_operation(config::Cia402Mode mode) noexcept;

// `target`: counts, counts/s or per mille; per mille must fit 16 bits.
CanFrame encode_rpdo(config::Cia402Mode mode, std::uint32_t node, std::uint16_t controlword,
                     std::int32_t target) noexcept;

struct DriveReport {
  std::uint16_t statusword = 0;
  std::int32_t position = 0;  // counts
  std::int16_t torque = 0;    // per mille
};
std::optional<DriveReport> decode_tpdo(const CanFrame& frame) noexcept;

// Statusword in the cyclic modes: a limit inside the drive acts; the target is obeyed.
inline constexpr std::uint16_t kInternalLimit = 0x0800, kFollowsTarget = 0x1000;

// CiA 402's state machine as the statusword tells it; `undefined`: none of the eight patterns.
enum class PowerState : std::uint8_t {
  not_ready,
  switch_on_disabled,
  ready,
  switched_on,
  operation_enabled,
  quick_stop,
  fault_reaction,
  fault,
  undefined
};
PowerState power_state(std::uint16_t statusword) noexcept;

inline constexpr std::uint16_t kDisableVoltage = 0x00, kShutdown = 0x06, kSwitchOn = 0x07, kEnableOperation = 0x0F,
                               kFaultReset = 0x80;
// The controlword that leads one step from `state` towards operation. Disable voltage where that is not for us to
// decide: faults are reset and quick stops left on the way down only.
std::uint16_t step_up(PowerState state) noexcept;

}  // namespace takt::drivers::cia402
