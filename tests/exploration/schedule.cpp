#include "tests/exploration/schedule.hpp"

#include <fmt/format.h>

#include <array>
#include <random>
#include <string_view>

namespace takt::exploration {

std::vector<Event> draw(std::uint64_t seed, std::size_t joints, std::size_t buses, Duration lasting) {
  std::mt19937_64 random(seed);
  const auto below = [&random](std::uint64_t most) { return random() % most; };
  const Duration from = seconds(1);
  const auto span_us = static_cast<std::uint64_t>((lasting - seconds(2)).ns / 1000);
  std::vector<Event> events(1 + below(8));
  for (Event& event : events) {
    event.what = static_cast<Happening>(below(kHappenings));
    event.at = from + microseconds(static_cast<std::int64_t>(below(span_us)));
    // From a few ticks to what every time-out of the robot is shorter than: each order of magnitude as often.
    constexpr std::array<std::uint64_t, 4> kLongest_ms{10, 60, 300, 1200};
    event.length = microseconds(static_cast<std::int64_t>(1 + below(1000 * kLongest_ms.at(below(kLongest_ms.size())))));
    event.joint = below(event.what == Happening::bus_off || event.what == Happening::frames_lost ? buses : joints);
  }
  return events;
}

std::string text(const Event& event) {
  constexpr std::array<std::string_view, kHappenings> kNames{
      "clock stalls", "send stalls",     "receive stalls", "wake-ups late", "policy silent",
      "policy slow",  "policy nonsense", "drive silent",   "drive deaf",    "drive repeats",
      "drive late",   "drive error",     "drive restarts", "bus off",       "frames lost",
      "shove",        "operator stop",   "power off",      "recorder ends"};
  return fmt::format("{:.3f} s: {} of {}, for {:.1f} ms", event.at.seconds(),
                     kNames.at(static_cast<std::size_t>(event.what)), event.joint, event.length.milliseconds());
}

}  // namespace takt::exploration
