// SPDX-License-Identifier: Apache-2.0
// What the executive concludes about a message from a policy (Arrival, once per message) and about the command in
// use (Freshness, every tick). Names are stable: they appear in records, reports and metrics.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace takt {

// Outcome of looking into the command mailbox this tick. Anything but `none` and `accepted` is a refusal, counted.
enum class Arrival : std::uint8_t {
  none,                 // nothing new
  accepted,             // became the command in use, or waits for its turn
  contended,            // the writer overtook every bounded try; counts as nothing new
  corrupt,              // CRC or size wrong
  wrong_shape,          // joint count, step count, field mask, period or reserved bytes off
  wrong_policy,         // policy hash is not the configured one
  repeated_sequence,    // sequence not greater than the last accepted one
  unknown_observation,  // answers an id never published
  expired_observation,  // answers an id so old that it was forgotten, or older than max_age
  future_observation,   // answers an id not yet published, or carries stamps from the future
  not_finite,           // NaN or infinity inside
  out_of_range,         // a value too large to be any joint's target (what exceeds a joint's range is clamped)
  missing_stamp,        // does not say when its outside sensors sensed, although the robot's policy uses some
  overtaken,            // answers an older observation than the command in use does
};
inline constexpr std::size_t kArrivalCount = 14;

constexpr bool is_refusal(Arrival arrival) {
  return arrival != Arrival::none && arrival != Arrival::accepted;
}
// Refused because it came too late. Lateness is the freshness contract's business (degraded, command_lost), never an
// integration error (bad_commands).
constexpr bool is_refused_for_age(Arrival arrival) {
  return arrival == Arrival::expired_observation || arrival == Arrival::overtaken;
}

// State of the command in use at this tick.
enum class Freshness : std::uint8_t {
  missing,  // no command accepted yet, or its chunk is spent
  fresh,    // age <= aging_fraction * max_age
  aging,    // fresh still, but past aging_fraction * max_age
  stale,    // age > max_age: not playable
};
inline constexpr std::size_t kFreshnessCount = 4;

constexpr bool is_usable(Freshness freshness) {
  return freshness == Freshness::fresh || freshness == Freshness::aging;
}

constexpr std::string_view name(Arrival arrival) {
  constexpr std::array<std::string_view, kArrivalCount> names{"none",
                                                              "accepted",
                                                              "contended",
                                                              "corrupt",
                                                              "wrong_shape",
                                                              "wrong_policy",
                                                              "repeated_sequence",
                                                              "unknown_observation",
                                                              "expired_observation",
                                                              "future_observation",
                                                              "not_finite",
                                                              "out_of_range",
                                                              "missing_stamp",
                                                              "overtaken"};
  const auto index = static_cast<std::size_t>(arrival);
  return index < names.size() ? names[index] : "invalid";
}

constexpr std::string_view name(Freshness freshness) {
  constexpr std::array<std::string_view, kFreshnessCount> names{"missing", "fresh", "aging", "stale"};
  const auto index = static_cast<std::size_t>(freshness);
  return index < names.size() ? names[index] : "invalid";
}

}  // namespace takt
