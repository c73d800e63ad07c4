// SPDX-License-Identifier: Apache-2.0
// The places that a policy's host can take at a robot, each with a mailbox, a session and a judgement of its own in
// every tick. A structure that has something of each seat has it as PerSeat.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "executive/contract/layout.hpp"

namespace takt {

// `policy` is in charge of the robot; `fallback` moves it while that one is late, where the robot file says so;
// `candidate` runs beside the policy, is judged and compared, and may be put in its place on a live robot.
enum class Seat : std::uint8_t { policy, fallback, candidate };
inline constexpr std::size_t kSeatCount = 3;
inline constexpr std::array<Seat, kSeatCount> kSeats{Seat::policy, Seat::fallback, Seat::candidate};

constexpr std::string_view name(Seat seat) {
  constexpr std::array<std::string_view, kSeatCount> names{"policy", "fallback", "candidate"};
  const auto index = static_cast<std::size_t>(seat);
  return index < names.size() ? names[index] : "invalid";
}

// One of each seat. Index: any Seat of kSeats.
template <class Each>
struct PerSeat {
  Each values[kSeatCount];
  constexpr Each& operator[](Seat seat) { return values[static_cast<std::size_t>(seat)]; }
  constexpr const Each& operator[](Seat seat) const { return values[static_cast<std::size_t>(seat)]; }
};
template <class Each>
constexpr auto fields_of(Shared<PerSeat<Each>>) {
  using Of = PerSeat<Each>;
  return std::array{TAKT_FIELD(values)};
}

}  // namespace takt
