// SPDX-License-Identifier: Apache-2.0
// Judges one message from a policy, in a fixed order; the first failing check names the refusal:
//
//  1 wrong_shape          byte count, at most the robot's largest legal chunk; counts, mask, reserved, step period; dq
//                         missing where steps are joined by cubics, or there where they are joined by lines
//  2 wrong_policy         hash differs from the configured one (0 accepts any)
//  3 repeated_sequence    not greater than the last accepted one of this policy session
//  4 unknown_observation  id 0
//    future_observation   an id not published yet
//    expired_observation  a forgotten one
//  5 missing_stamp        no stamp of outside sensors, although the robot's policy uses some
//    future_observation   any stamp more than a period later than now
//  6 not_finite           NaN or infinity among the values
//  7 out_of_range         a value beyond kLargestTarget: no target of any joint (what lies outside a joint's own range
//                         is clamped where it is played, chunk_player.hpp, and counted)
//  8 expired_observation  older than max_age on arrival
//  9 overtaken            answers an older observation than the newest command does: it would make the robot older
//
// Stamps that run backwards are clamped and counted, not refused: they spoil the decomposition, never the total.
// An outside sensor's stamp can only make the command older. Pure; reads values only after the shape was found sound,
// and not where `values` says what was found in them (replay).
#pragma once

#include <cstddef>
#include <cstdint>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/verdict.hpp"
#include "executive/pipeline/command_in_use.hpp"
#include "executive/pipeline/observation_memory.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

inline constexpr float kLargestTarget = 1.0e6F;  // in any unit: garbage, or a unit mistaken by orders of magnitude
inline constexpr Duration kLongestStepPeriod = seconds(10);

struct ArrivalVerdict {
  Arrival arrival = Arrival::none;
  bool stamps_ran_backwards = false;
  CommandInUse command;      // meaningful when accepted
  MonoTime committed_until;  // what the answered observation promised; meaningful when accepted
};

// The policy whose message is judged, and what it said before. `newest`: the one accepted last, whether it is in use
// yet or waits.
struct Sender {
  const ExpectedPolicy& expected;
  std::uint64_t last_sequence;
  const CommandInUse& newest;
  std::uint8_t session = 0;       // of its mailbox
  std::uint8_t of_candidate = 0;  // 1: that mailbox is the candidate's
};
ArrivalVerdict judge_arrival(const CommandChunk& chunk, std::size_t bytes, MonoTime now, const Sender& sender,
                             const ObservationMemory& memory, const TickConfig& config, Arrival values = Arrival::none);
// What a refused message tells without its values: checks 6 and 7, of which `arrival` is the outcome. A message that
// did not get there, or failed later, has nothing wrong with its values as far as the outcome goes.
constexpr Arrival values_behind(Arrival arrival) {
  return arrival == Arrival::not_finite || arrival == Arrival::out_of_range ? arrival : Arrival::accepted;
}

}  // namespace takt::pipeline
