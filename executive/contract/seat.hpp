// SPDX-License-Identifier: Apache-2.0
// The places that a policy's host can take at a robot, each with a mailbox, a session and a judgement of its own in
// every tick. A structure that has something of each seat has it as PerSeat.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
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

// Whose chunk the robot follows in a tick, or whose message is told of: the candidate never moves the robot, it becomes
// the policy.
enum class Player : std::uint8_t { none, policy, fallback, candidate };
inline constexpr std::size_t kPlayerCount = 1 + kSeatCount;
inline constexpr std::size_t kMoverCount = 3;  // the first of them: whose chunk a robot can follow

constexpr std::string_view name(Player player) {
  constexpr std::array<std::string_view, kPlayerCount> names{"none", "policy", "fallback", "candidate"};
  const auto index = static_cast<std::size_t>(player);
  return index < names.size() ? names[index] : "invalid";
}

// None: of no seat, or no player at all.
constexpr std::optional<Seat> seat_of(Player player) {
  if (player == Player::none || static_cast<std::size_t>(player) >= kPlayerCount) return std::nullopt;
  return static_cast<Seat>(static_cast<std::size_t>(player) - 1);
}
constexpr Player player_of(Seat seat) {
  return static_cast<Player>(static_cast<std::size_t>(seat) + 1);
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
