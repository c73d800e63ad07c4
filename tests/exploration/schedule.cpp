#include "tests/exploration/schedule.hpp"

#include <fmt/format.h>

#include <array>
#include <random>
#include <string_view>

namespace takt::exploration {

std::vector<Event> draw(std::uint64_t seed, std::size_t joints, std::size_t buses, Duration lasting) {
  constexpr auto kDrawn =
      static_cast<unsigned>(Happening::imu_frozen);  // later ones strike alone: seeds stay as they are
  std::mt19937_64 random(seed);
  const auto below = [&random](std::uint64_t most) { return random() % most; };
  const Duration from = seconds(1);
  const auto span_us = static_cast<std::uint64_t>((lasting - seconds(2)).ns / 1000);
  std::vector<Event> events(1 + below(8));
  for (Event& event : events) {
    event.what = static_cast<Happening>(below(kDrawn));
    event.at = from + microseconds(static_cast<std::int64_t>(below(span_us)));
    // From a few ticks to what every time-out of the robot is shorter than: each order of magnitude as often.
    constexpr std::array<std::uint64_t, 4> kLongest_ms{10, 60, 400, 3000};
    event.length = microseconds(static_cast<std::int64_t>(1 + below(1000 * kLongest_ms.at(below(kLongest_ms.size())))));
    event.index = below(is_of_bus(event.what) ? buses : joints);
  }
  return events;
}

std::string text(const Event& event) {
  constexpr std::array<std::string_view, kHappenings> kNames{"clock stalls",
                                                             "send stalls",
                                                             "receive stalls",
                                                             "wake-ups late",
                                                             "policy silent",
                                                             "policy slow",
                                                             "policy nonsense",
                                                             "drive silent",
                                                             "drive deaf",
                                                             "drive repeats",
                                                             "drive late",
                                                             "drive error",
                                                             "drive restarts",
                                                             "drive disabled",
                                                             "drive hot",
                                                             "shove",
                                                             "hurl",
                                                             "bus off",
                                                             "bus down",
                                                             "error-passive",
                                                             "frames refused",
                                                             "receive overflow",
                                                             "babble",
                                                             "stranger on an id",
                                                             "frames undated",
                                                             "frames lost",
                                                             "recorder ends",
                                                             "operator stop",
                                                             "power off",
                                                             "computer sleeps",
                                                             "computer sleeps in a tick",
                                                             "shutdown",
                                                             "torque output fails",
                                                             "IMU silent",
                                                             "IMU lies",
                                                             "base leans",
                                                             "fallback silent",
                                                             "IMU frozen",
                                                             "IMU late"};
  return fmt::format("{:.3f} s: {} of {}, for {:.1f} ms", event.at.seconds(),
                     kNames.at(static_cast<std::size_t>(event.what)), event.index, event.length.milliseconds());
}

}  // namespace takt::exploration
