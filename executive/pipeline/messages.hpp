// SPDX-License-Identifier: Apache-2.0
// What a policy's message becomes: judged (arrival.hpp), taken into the path by the join rule, or kept until its turn.
#pragma once

#include "executive/pipeline/arrival.hpp"
#include "executive/pipeline/freshness.hpp"
#include "executive/pipeline/tick_state.hpp"

namespace takt::pipeline {

// Sequence of what a mailbox gave; 0: nothing, or nothing readable.
std::uint64_t sequence_seen(const PolicyMessage& message);
// What the seat's command is worth at `now`.
inline Freshness freshness_of(const SeatState& seat, MonoTime now, const FreshnessContract& contract) {
  return freshness_of(seat.command, seat.chunk.header, now, contract);
}
// Judges the message of a seat's policy; another session than before begins anew. Nothing there: arrival is `none`, or
// why it could not be read.
ArrivalVerdict hear_policy(TickState& state, Seat seat, const PolicyMessage& message, const ExpectedPolicy& expected,
                           MonoTime now, const TickConfig& config);
void remember_refusal(SeatState& seat, Arrival arrival);
// The chunk begins the seat's path or, where `joins`, goes on from the one there is.
void begin_or_join(SeatState& seat, bool joins, const CommandChunk& chunk, const CommandInUse& command, MonoTime now,
                   const TickConfig& config);
// What a record says of the seat's command.
void record_seat(const SeatState& seat, MonoTime now, const TickConfig& config, SeatRecord& record);

// The policy's accepted last, whether it is in use yet or waits.
const CommandInUse& newest_command(const TickState& state);
// The message of the policy in charge of this tick.
Arrival take_message(TickState& state, const PolicyMessage& message, MonoTime now, const TickConfig& config);
// An accepted message into the path: at once, or once what was promised is played.
void accept(TickState& state, const CommandChunk& chunk, const ArrivalVerdict& verdict, MonoTime now,
            const TickConfig& config);
// The chunk becomes, or joins, the path.
void take_over(TickState& state, const CommandChunk& chunk, const CommandInUse& command, MonoTime now,
               const TickConfig& config);
// What waits takes over once the promise is kept, or cannot be kept because there is nothing left to play.
void relieve(TickState& state, MonoTime now, const TickConfig& config);

// The fallback's message, and what it is worth in this tick.
void judge_fallback(TickState& state, const TickInput& input, const TickConfig& config, SeatRecord& record);

// The path of `to` takes over from where the references are.
void hand_over(TickState& state, Seat to, MonoTime now, const TickConfig& config);

}  // namespace takt::pipeline
