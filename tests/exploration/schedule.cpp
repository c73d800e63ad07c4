// SPDX-License-Identifier: Apache-2.0
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

std::vector<Event> draw_motion(std::uint64_t seed, std::size_t joints, std::size_t buses, Duration lasting,
                               Motions with) {
  constexpr std::array kGains{Happening::no_stiffness, Happening::no_stiffness, Happening::little_stiffness,
                              Happening::no_damping, Happening::little_damping};
  constexpr std::array kHands{Happening::hand_holds, Happening::hand_holds, Happening::hand_pulls, Happening::asks_far,
                              Happening::asks_far};
  constexpr std::array kOfCandidate{Happening::candidate_swap, Happening::candidate_back, Happening::candidate_silent,
                                    Happening::candidate_nonsense};
  constexpr auto kFirstLie = static_cast<unsigned>(Happening::says_frozen);
  constexpr auto kLies = static_cast<unsigned>(Happening::says_future) - kFirstLie + 1;
  std::mt19937_64 random(seed * 0xD134'2543'DE82'EF95ULL);
  const auto below = [&random](std::uint64_t most) { return random() % most; };
  const auto at_ms = [&below](std::uint64_t from, std::uint64_t until) {
    return milliseconds(static_cast<std::int64_t>(from + below(until - from)));
  };
  const auto last_ms = static_cast<std::uint64_t>(lasting.ns / milliseconds(1).ns) - 1000;
  std::vector<Event> events;
  for (std::uint64_t i = 1 + below(3); i != 0; --i) {
    const Happening what = kGains.at(below(kGains.size()));
    const Duration from = below(2) == 0 ? Duration{} : at_ms(500, last_ms);
    events.push_back({what, from, below(2) == 0 ? lasting : at_ms(200, 4000), below(joints)});
  }
  for (std::uint64_t i = below(3); i != 0; --i)
    events.push_back({kHands.at(below(kHands.size())), at_ms(1000, last_ms), at_ms(50, 3000), below(joints)});
  if (with.lies)
    events.push_back(
        {static_cast<Happening>(kFirstLie + below(kLies)), at_ms(1000, last_ms), at_ms(1, 2000), below(joints)});
  if (with.candidate) {
    const Duration swapped = at_ms(1000, last_ms / 2);
    events.push_back({Happening::candidate_swap, swapped, {}, 0});
    for (std::uint64_t i = below(3); i != 0; --i)
      events.push_back({kOfCandidate.at(below(kOfCandidate.size())), swapped + at_ms(1, 2500), at_ms(5, 1500), 0});
  }
  // What ends it: the general schedule, shortened to a few.
  std::vector<Event> others = draw(seed, joints, buses, lasting);
  others.resize(1 + (others.size() - 1) % 4);
  events.insert(events.end(), others.begin(), others.end());
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
                                                             "IMU late",
                                                             "no stiffness",
                                                             "little stiffness",
                                                             "no damping",
                                                             "little damping",
                                                             "far target",
                                                             "held by hand",
                                                             "pulled by hand",
                                                             "feedback frozen",
                                                             "feedback jumps",
                                                             "feedback wraps",
                                                             "feedback's sign",
                                                             "feedback's scale",
                                                             "feedback repeated",
                                                             "feedback from the future",
                                                             "swap asked",
                                                             "back asked",
                                                             "candidate silent",
                                                             "candidate nonsense"};
  return fmt::format("{:.3f} s: {} of {}, for {:.1f} ms", event.at.seconds(),
                     kNames.at(static_cast<std::size_t>(event.what)), event.index, event.length.milliseconds());
}

}  // namespace takt::exploration
