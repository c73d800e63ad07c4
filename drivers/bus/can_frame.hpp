// SPDX-License-Identifier: Apache-2.0
// One frame's translations: to and from the kernel's struct canfd_frame (whose CANFD_FDF flag marks FD frames, as
// Linux >= 6.2 does itself), and to and from the FrameRecord that the monitor receives.
//
// Shapes: classic frames carry 0..8 bytes, FD frames 0..8, 12, 16, 20, 24, 32, 48 or 64. Pure, no I/O.
// Source: linux/can.h.
#pragma once

#include <linux/can.h>

#include <cstdint>
#include <optional>

#include "drivers/bus/can_bus.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::drivers {

inline constexpr std::uint8_t kRecordFdFlag = 0x80;  // FrameRecord::fd_flags

// Id within its width, length possible for its kind.
bool is_legal(const CanFrame& frame);

// Precondition of the conversions from CanFrame: is_legal().
canfd_frame to_kernel(const CanFrame& frame);
// Nothing for a frame that no CAN bus can carry.
std::optional<CanFrame> from_kernel(const canfd_frame& frame);
std::optional<CanFrame> from_kernel(const can_frame& frame);

FrameRecord to_record(const CanFrame& frame, MonoTime stamp, std::uint64_t tick, std::uint8_t bus,
                      FrameDirection direction);
std::optional<CanFrame> from_record(const FrameRecord& record);

// Takes a filled id word (with CAN_EFF_FLAG, CAN_RTR_FLAG, CAN_ERR_FLAG) apart, and builds it.
std::uint32_t id_word(const CanFrame& frame);

}  // namespace takt::drivers
