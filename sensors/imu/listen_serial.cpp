// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>

#include "executive/contract/monotonic_clock.hpp"
#include "sensors/imu/listen.hpp"
#include "sensors/imu/mtdata2.hpp"
#include "sensors/imu/serial_port.hpp"

namespace takt::sensors {
namespace {

// No sample is younger than the wait in which it was read: a short one makes few of them older than they are.
constexpr Duration kPatience = milliseconds(2);

}  // namespace

std::string listen_serial(const std::string& port, std::uint32_t baud, ImuSeat& seat, const Signals& signals) {
  auto opened = SerialPort::open(port, baud);
  if (!opened) return opened.error();
  ImuFeed feed(seat);
  MtStream stream;
  WaitStart waits(kPatience);
  std::array<std::uint8_t, 4096> bytes{};
  bool is_babble = false;  // bytes came since the last message
  while (!signals.stop) {
    waits.begin(monotonic_now());
    const auto count = opened->read(bytes, kPatience, signals.while_waiting);
    if (!count) return count.error();
    is_babble = is_babble || *count > 0;
    for (const MtMessage& message : stream.take(std::span(bytes).first(*count), waits.taken(monotonic_now()))) {
      if (message.id != kMtData2) continue;
      is_babble = false;
      const auto sample = parse_mtdata2(message.data);
      if (sample)
        feed.publish(*sample, message.first_byte);
      else
        feed.refuse(sample.error());
    }
    feed.report(stream.counts().bad_checksums);
    if (feed.is_silent())
      return is_babble ? fmt::format("{}: bytes come, but no MTData2: does the MTi speak at {} baud?", port, baud)
                       : port + ": nothing comes: is the MTi connected, and in measurement mode?";
  }
  return {};
}

}  // namespace takt::sensors
