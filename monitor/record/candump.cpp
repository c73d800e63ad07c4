// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/candump.hpp"

#include <linux/can.h>
#include <linux/can/error.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <optional>

#include "drivers/bus/can_frame.hpp"

namespace takt::monitor {
namespace {

constexpr std::string_view kHex = "0123456789ABCDEF";
constexpr std::size_t kMicroDigits = 6;

void append_hex(std::string& out, std::uint32_t value, int digits) {
  for (int digit = digits - 1; digit >= 0; --digit) out += kHex[value >> (4 * digit) & 0xFU];
}

// Whole text as a number, else nothing.
template <class Number>
std::optional<Number> number(std::string_view text, int base) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::unexpected<std::string> wrong(std::string_view text, const char* what) {
  return std::unexpected("'" + std::string(text) + "': " + what);
}

bool read_data(std::string_view hex, drivers::CanFrame& frame) {
  if (hex.size() % 2 != 0 || hex.size() > 2 * sizeof frame.data) return false;
  for (std::size_t i = 0; i < hex.size(); i += 2) {
    const auto byte = number<std::uint8_t>(hex.substr(i, 2), 16);
    if (!byte) return false;
    frame.data[i / 2] = *byte;
  }
  frame.length = static_cast<std::uint8_t>(hex.size() / 2);
  return true;
}

bool read_body(std::string_view body, drivers::CanFrame& frame) {
  if (body.starts_with('#')) {
    if (body.size() < 2) return false;
    const auto flags = number<unsigned>(body.substr(1, 1), 16);
    if (!flags) return false;
    frame.fd = true;
    frame.bit_rate_switch = (*flags & CANFD_BRS) != 0;
    return read_data(body.substr(2), frame);
  }
  if (body.starts_with('R') || body.starts_with('r')) {
    frame.remote = true;
    const auto length = body.size() == 1 ? std::uint8_t{0} : number<std::uint8_t>(body.substr(1), 16);
    if (!length) return false;
    frame.length = *length;
    return true;
  }
  return read_data(body, frame);
}

// Next word, cut off the front.
std::string_view next_word(std::string_view& line) {
  line.remove_prefix(std::min(line.find_first_not_of(" \t\r\n"), line.size()));
  const std::size_t end = std::min(line.find_first_of(" \t\r\n"), line.size());
  const std::string_view found = line.substr(0, end);
  line.remove_prefix(end);
  return found;
}

std::optional<std::int64_t> read_stamp(std::string_view text) {
  if (!text.starts_with('(') || !text.ends_with(')')) return std::nullopt;
  const std::size_t point = text.find('.');
  if (point == std::string_view::npos || text.size() != point + kMicroDigits + 2) return std::nullopt;
  const auto whole = number<std::uint32_t>(text.substr(1, point - 1), 10);
  const auto micros = number<std::uint32_t>(text.substr(point + 1, kMicroDigits), 10);
  if (!whole || !micros) return std::nullopt;
  return std::int64_t{*whole} * 1'000'000'000 + std::int64_t{*micros} * 1'000;
}

}  // namespace

void append_frame_text(std::string& out, const drivers::CanFrame& frame) {
  append_hex(out, frame.error ? frame.id | CAN_ERR_FLAG : frame.id, frame.extended || frame.error ? 8 : 3);
  out += '#';
  if (frame.remote) {
    out += 'R';
    if (frame.length > 0) out += kHex[frame.length];
    return;
  }
  if (frame.fd) {
    out += '#';
    out += frame.bit_rate_switch ? '1' : '0';
  }
  for (std::size_t i = 0; i < frame.length; ++i) append_hex(out, frame.data[i], 2);
}

std::expected<drivers::CanFrame, std::string> parse_frame_text(std::string_view text) {
  const std::size_t mark = text.find('#');
  if (mark != 3 && mark != 8) return wrong(text, "a frame is a 3- or 8-digit hexadecimal id, '#' and its data");
  const auto id = number<std::uint32_t>(text.substr(0, mark), 16);
  if (!id) return wrong(text, "the id is not hexadecimal");
  drivers::CanFrame frame;
  frame.error = (*id & CAN_ERR_FLAG) != 0;
  frame.extended = mark == 8 && !frame.error;
  frame.id = frame.error ? *id & ~CAN_ERR_FLAG : *id;
  if (!read_body(text.substr(mark + 1), frame)) return wrong(text, "the data is not pairs of hexadecimal digits");
  if (!drivers::is_legal(frame)) return wrong(text, "no CAN bus carries a frame of this id and length");
  return frame;
}

void append_candump_line(std::string& out, const FrameRecord& record, std::string_view interface,
                         std::int64_t monotonic_to_unix_ns) {
  const std::int64_t micros = std::max<std::int64_t>(record.stamp.ns + monotonic_to_unix_ns, 0) / 1'000;
  char stamp[40];
  std::snprintf(stamp, sizeof stamp, "(%010lld.%06lld) ", static_cast<long long>(micros / 1'000'000),
                static_cast<long long>(micros % 1'000'000));
  const std::optional<drivers::CanFrame> frame = drivers::from_record(record);
  if (!frame) out += "# not a frame: ";
  if (record.direction == FrameDirection::refused) out += "# refused: ";
  out += stamp;
  out += interface;
  out += ' ';
  if (frame)
    append_frame_text(out, *frame);
  else
    append_hex(out, record.can_id, 8);
  out += record.direction == FrameDirection::received ? " R\n" : " T\n";
}

std::expected<LoggedFrame, std::string> parse_candump_line(std::string_view line) {
  std::string_view rest = line;
  LoggedFrame logged;
  const std::optional<std::int64_t> stamp = read_stamp(next_word(rest));
  if (!stamp) return wrong(line, "a line starts with (seconds.microseconds)");
  logged.unix_ns = *stamp;
  logged.interface = next_word(rest);
  if (logged.interface.empty()) return wrong(line, "the interface is missing");
  auto frame = parse_frame_text(next_word(rest));
  if (!frame) return std::unexpected(frame.error());
  logged.frame = *frame;
  const std::string_view direction = next_word(rest);
  if (!direction.empty() && direction != "R" && direction != "T")
    return wrong(line, "the direction is neither R nor T");
  if (!next_word(rest).empty()) return wrong(line, "something follows the frame");
  if (direction == "T") logged.direction = FrameDirection::sent;
  return logged;
}

}  // namespace takt::monitor
