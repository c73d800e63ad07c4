// SPDX-License-Identifier: Apache-2.0
// CAN frames as text in can-utils' log grammar, so that candump -L, canplayer, log2asc and python-can work on our
// files:
//   (1700000000.123456) can0 123#DEADBEEF R      standard id: 3 hex digits; extended: 8
//   (1700000000.123456) can0 00012345#R4 T       remote request for 4 bytes
//   (1700000000.123456) can0 123##1AABB R        FD; the digit after ## holds BRS (1) and ESI (2)
//   (1700000000.123456) can0 20000040#0000000000000000 R   error frame: CAN_ERR_FLAG in the id
// Stamps are Unix time; nanoseconds are cut to microseconds. R or T, as `candump -x` writes it, is optional on reading.
// Source: can-utils lib.h, candump.c. Thread rule: none of its own.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <string_view>

#include "drivers/bus/can_bus.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::monitor {

// "123#DEADBEEF". Precondition: is_legal(frame).
void append_frame_text(std::string& out, const drivers::CanFrame& frame);
// The sentence says what is wrong with the text.
std::expected<drivers::CanFrame, std::string> parse_frame_text(std::string_view text);

// One line with its newline. A record that holds no legal frame, or one that never reached the bus, becomes a line of
// its own kind, `# ...`, which readers of the grammar skip or refuse but never mistake for a frame.
void append_candump_line(std::string& out, const FrameRecord& record, std::string_view interface,
                         std::int64_t monotonic_to_unix_ns);

struct LoggedFrame {
  std::int64_t unix_ns = 0;
  std::string interface;
  drivers::CanFrame frame;
  FrameDirection direction = FrameDirection::received;
};
std::expected<LoggedFrame, std::string> parse_candump_line(std::string_view line);

}  // namespace takt::monitor
