// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/messages.hpp"

#include <algorithm>
#include <array>

#include "executive/pipeline/candidate.hpp"

namespace takt::pipeline {
namespace {

// Only what the robot follows is joined with what comes: a path that is not played leads nowhere.
bool plays(const TickState& state, Seat seat, MonoTime now, const TickConfig& config) {
  return state.mode.player == player_of(seat) && is_usable(freshness_of(state.seats[seat], now, config.freshness));
}

}  // namespace

std::uint64_t sequence_seen(const PolicyMessage& message) {
  const bool readable =
      message.mailbox == Arrival::accepted && message.command != nullptr && message.bytes >= sizeof(CommandHeader);
  return readable ? message.command->header.sequence : 0;
}

ArrivalVerdict hear_policy(TickState& state, Seat seat, const PolicyMessage& message, const ExpectedPolicy& expected,
                           MonoTime now, const TickConfig& config) {
  SeatState& own = state.seats[seat];
  if (message.session != own.session) {
    own.session = message.session;
    own.last_sequence = 0;
    own.last_refusal = Arrival::none;
    if (seat == Seat::policy) own.join.delays.forget();
  }
  ArrivalVerdict verdict;
  if (message.mailbox != Arrival::accepted || message.command == nullptr) {
    const bool failed = message.mailbox == Arrival::contended || message.mailbox == Arrival::corrupt;
    verdict.arrival = failed ? message.mailbox : Arrival::none;
    return verdict;
  }
  const CommandInUse& newest = seat == Seat::policy ? newest_command(state) : own.command;
  // Of the two that change places: whose mailbox it is that this seat has now.
  const bool is_candidates = seat == Seat::fallback    ? false
                             : seat == Seat::candidate ? state.candidate.in_charge == 0
                                                       : state.candidate.in_charge != 0;
  verdict =
      judge_arrival(*message.command, message.bytes, now,
                    {expected, own.last_sequence, newest, message.session, static_cast<std::uint8_t>(is_candidates)},
                    state.memory, config, message.values);
  state.counters.integration_errors += verdict.stamps_ran_backwards ? 1U : 0U;
  if (verdict.arrival == Arrival::accepted) own.last_sequence = verdict.command.sequence;
  return verdict;
}

void remember_refusal(SeatState& seat, Arrival arrival) {
  if (arrival != Arrival::none) seat.last_refusal = is_refusal(arrival) ? arrival : Arrival::none;
}

void begin_or_join(SeatState& seat, bool joins, const CommandChunk& chunk, const CommandInUse& command, MonoTime now,
                   const TickConfig& config) {
  if (joins)
    join_path(seat.join, seat.chunk, seat.command.begins(), {chunk, command.begins()}, now, config);
  else
    begin_path(seat.join, seat.chunk, chunk);
  seat.command = command;
}

void record_seat(const SeatState& seat, MonoTime now, const TickConfig& config, SeatRecord& record) {
  record.last_refusal = seat.last_refusal;
  record.command_sequence = seat.command.sequence;
  record.observation_answered = seat.command.observation_id;
  record.freshness = freshness_of(seat, now, config.freshness);
  if (record.freshness != Freshness::missing) record.age = seat.command.age(now);
}

void take_over(TickState& state, const CommandChunk& chunk, const CommandInUse& command, MonoTime now,
               const TickConfig& config) {
  SeatState& policy = state.seats[Seat::policy];
  begin_or_join(policy, plays(state, Seat::policy, now, config), chunk, command, now, config);
  policy.command.first_used_at = now;
  state.waiting.command = {};
}

void accept(TickState& state, const CommandChunk& chunk, const ArrivalVerdict& verdict, MonoTime now,
            const TickConfig& config) {
  const bool played = plays(state, Seat::policy, now, config);
  if (played)
    state.seats[Seat::policy].join.delays.note(now, now - std::max(verdict.command.observed_at, state.mode.resumed_at));
  if (config.join.kind != JoinKind::prefix || !played || now >= verdict.committed_until)
    return take_over(state, chunk, verdict.command, now, config);
  state.waiting = {verdict.command, verdict.committed_until};
  state.waiting_chunk.header = chunk.header;
  std::copy_n(chunk.values, chunk.value_count(), state.waiting_chunk.values);
}

void relieve(TickState& state, MonoTime now, const TickConfig& config) {
  if (state.waiting.command.sequence == 0 || (now < state.waiting.due && plays(state, Seat::policy, now, config)))
    return;
  const CommandInUse command = state.waiting.command;
  take_over(state, state.waiting_chunk, command, now, config);
}

const CommandInUse& newest_command(const TickState& state) {
  return state.waiting.command.sequence != 0 ? state.waiting.command : state.seats[Seat::policy].command;
}

Arrival take_message(TickState& state, const PolicyMessage& message, MonoTime now, const TickConfig& config) {
  const ArrivalVerdict verdict =
      hear_policy(state, Seat::policy, message, expected_in_charge(state, config), now, config);
  if (verdict.arrival == Arrival::accepted) accept(state, *message.command, verdict, now, config);
  return verdict.arrival;
}

// Nothing is promised while it plays, so that nothing of its waits. Its refusals are told, and stop nothing: it is not
// fresh then.
void judge_fallback(TickState& state, const TickInput& input, const TickConfig& config, SeatRecord& record) {
  SeatState& fallback = state.seats[Seat::fallback];
  const PolicyMessage& message = input.messages[Seat::fallback];
  const ArrivalVerdict verdict = hear_policy(state, Seat::fallback, message, config.fallback_policy, input.now, config);
  if (verdict.arrival == Arrival::accepted)
    begin_or_join(fallback, plays(state, Seat::fallback, input.now, config), *message.command, verdict.command,
                  input.now, config);
  record.arrival = verdict.arrival;
  remember_refusal(fallback, verdict.arrival);
  record_seat(fallback, input.now, config, record);
  if (is_usable(record.freshness)) state.fallback.last_usable_at = input.now;
}

void hand_over(TickState& state, Seat to, MonoTime now, const TickConfig& config) {
  std::array<PathPoint, kMaxJoints> references;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const auto& [q, dq, ddq] = state.joints[j].reference;
    references[j] = {static_cast<float>(q), static_cast<float>(dq), static_cast<float>(ddq)};
  }
  SeatState& seat = state.seats[to];
  join_references(seat.join, {seat.chunk, seat.command.begins()}, {references.data(), config.joint_count}, now, config);
}

}  // namespace takt::pipeline
