#include "drivers/bus_load.hpp"

#include <cstdio>

namespace takt::drivers {
namespace {

std::uint32_t stuffable_bits(std::size_t bytes, bool extended) {
  return (extended ? 54U : 34U) + 8U * static_cast<std::uint32_t>(bytes);
}

constexpr std::size_t kMitCommandBytes = 8;

std::size_t reply_bytes(const config::Drive& drive) {
  return drive.variant == "tmotor" ? 6 : 8;
}

std::string overload_sentence(const config::RobotConfig& robot, const config::Bus& bus, const BusLoad& load) {
  const double rate = 1e9 / static_cast<double>(robot.control.period.ns);
  char text[400];
  std::snprintf(
      text, sizeof text,
      "%s: bus %s cannot carry its %zu drives: %u bits per tick (commands and replies, worst stuffing) x %.0f "
      "ticks/s = %.0f bit/s = %.0f %% of %u bit/s, more than %.0f %%: move drives to another bus or lengthen "
      "control.period",
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

std::expected<std::vector<BusLoad>, std::string> check_bus_load(const config::RobotConfig& robot) {
  std::vector<BusLoad> loads;
  for (std::size_t index = 0; index < robot.buses.size(); ++index) {
    const config::Bus& bus = robot.buses[index];
    BusLoad load;
    load.bus = bus.name;
    for (const config::Joint& joint : robot.joints) {
      if (joint.bus != index) continue;
      ++load.drives;
      load.bits_per_tick += most_frame_bits(kMitCommandBytes, false) + most_frame_bits(reply_bytes(joint.drive), false);
    }
    load.load = load.bits_per_tick / (robot.control.period.seconds() * bus.bitrate);
    if (load.load > kMaxBusLoad) return std::unexpected(overload_sentence(robot, bus, load));
    loads.push_back(std::move(load));
  }
  return loads;
}

}  // namespace takt::drivers
