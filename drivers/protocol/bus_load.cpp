// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/bus_load.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "config/turns.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::drivers {
namespace {

std::uint32_t stuffable_bits(std::size_t bytes, bool extended) {
  return (extended ? 54U : 34U) + 8U * static_cast<std::uint32_t>(bytes);
}

std::string overload_sentence(const config::RobotConfig& robot, const config::Bus& bus, const BusLoad& load) {
  const double rate = 1e9 / static_cast<double>(robot.control.period.ns);
  char text[400];
  std::snprintf(
      text, sizeof text,
      "%s: bus %s cannot carry its %zu drives: %u bits per tick (commands and replies, worst stuffing) x %.0f "
      "ticks/s = %.0f bit/s = %.0f %% of %u bit/s, more than %.0f %%: move drives to another bus, write to some "
      "every few ticks (drive.every) or lengthen control.period",
      robot.file.c_str(), bus.name.c_str(), load.drives, load.bits_per_tick, rate, rate * load.bits_per_tick,
      load.load * 100, bus.bitrate, kMaxBusLoad * 100);
  return text;
}

}  // namespace

std::uint32_t least_frame_bits(std::size_t bytes, bool extended) {
  return (extended ? 67U : 47U) + 8U * static_cast<std::uint32_t>(bytes);
}

std::uint32_t most_frame_bits(std::size_t bytes, bool extended) {
  return least_frame_bits(bytes, extended) + (stuffable_bits(bytes, extended) - 1) / 4;
}

FdFrameBits most_fd_frame_bits(std::size_t bytes, bool extended) {
  const std::uint32_t head = extended ? 36 : 17;  // start of frame to the bit that switches the rate
  const std::uint32_t tail = 12;                  // acknowledgement, end of frame, pause
  const auto payload = static_cast<std::uint32_t>(5 + 8 * bytes);
  const std::uint32_t check = 4 + (bytes > 16 ? 21U : 17U);
  return {head + (head - 1) / 4 + tail, payload + payload / 4 + check + (check + 3) / 4 + 1};
}

double bit_times(const FrameTraffic& frame, const config::Bus& bus) {
  if (!frame.fd) return frame.per_tick * most_frame_bits(frame.bytes, frame.extended);
  const FdFrameBits bits = most_fd_frame_bits(frame.bytes, frame.extended);
  return frame.per_tick * (bits.arbitration + bits.data * static_cast<double>(bus.bitrate) / bus.data_bitrate);
}

std::expected<std::vector<BusLoad>, std::string> check_bus_load(const config::RobotConfig& robot) {
  std::vector<BusLoad> loads;
  const std::vector<Turns> turns = config::turns_of(robot);
  for (std::size_t index = 0; index < robot.buses.size(); ++index) {
    const config::Bus& bus = robot.buses[index];
    BusLoad load;
    load.bus = bus.name;
    double undivided = 0;
    std::array<double, config::kTurnPattern> bits{};
    for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
      const Protocol* const protocol = find_protocol(robot.joints[joint].drive.protocol);
      if (robot.joints[joint].bus != index || protocol == nullptr) continue;
      ++load.drives;
      double each = 0;
      for (const FrameTraffic& frame : protocol->traffic(robot, joint)) each += bit_times(frame, bus);
      undivided += each;
      for (std::size_t tick = 0; tick < bits.size(); ++tick)
        if (turns[joint].has(tick)) bits[tick] += each;
    }
    load.bits_per_tick = static_cast<std::uint32_t>(std::ceil(std::ranges::max(bits)));
    load.undivided = std::ceil(undivided) / (robot.control.period.seconds() * bus.bitrate);
    load.load = load.bits_per_tick / (robot.control.period.seconds() * bus.bitrate);
    if (load.load > kMaxBusLoad) return std::unexpected(overload_sentence(robot, bus, load));
    loads.push_back(std::move(load));
  }
  return loads;
}

}  // namespace takt::drivers
