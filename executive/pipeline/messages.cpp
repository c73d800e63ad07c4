// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/messages.hpp"

#include <algorithm>
#include <array>

#include "executive/pipeline/candidate.hpp"
#include "executive/pipeline/freshness.hpp"

namespace takt::pipeline {
namespace {

// Only what the robot follows is joined with what comes: a path that nobody plays leads nowhere.
bool plays(const TickState& state, MonoTime now, const TickConfig& config) {
  return state.mode.player == Player::policy &&
         is_usable(freshness_of(state.command, state.chunk.header, now, config.freshness));
}

bool fallback_plays(const TickState& state, MonoTime now, const TickConfig& config) {
  return state.mode.player == Player::fallback &&
         is_usable(freshness_of(state.fallback.command, state.fallback_chunk.header, now, config.freshness));
}

}  // namespace

std::uint64_t sequence_seen(const PolicyMessage& message) {
  const bool readable =
      message.mailbox == Arrival::accepted && message.command != nullptr && message.bytes >= sizeof(CommandHeader);
  return readable ? message.command->header.sequence : 0;
}

bool is_there(const PolicyMessage& message, Arrival& verdict) {
  const bool failed = message.mailbox == Arrival::contended || message.mailbox == Arrival::corrupt;
  verdict = failed ? message.mailbox : Arrival::none;
  return message.mailbox == Arrival::accepted && message.command != nullptr;
}

void take_over(TickState& state, const CommandChunk& chunk, const CommandInUse& command, MonoTime now,
               const TickConfig& config) {
  if (plays(state, now, config))
    join_path(state.join, state.chunk, state.command.begins(), {chunk, command.begins()}, now, config);
  else
    begin_path(state.join, state.chunk, chunk);
  state.command = command;
  state.command.first_used_at = now;
  state.waiting.command = {};
}

void accept(TickState& state, const CommandChunk& chunk, const ArrivalVerdict& verdict, MonoTime now,
            const TickConfig& config) {
  state.counters.last_sequence = verdict.command.sequence;
  const bool played = plays(state, now, config);
  if (played) state.join.delays.note(now, now - std::max(verdict.command.observed_at, state.mode.resumed_at));
  if (config.join.kind != JoinKind::prefix || !played || now >= verdict.committed_until)
    return take_over(state, chunk, verdict.command, now, config);
  state.waiting = {verdict.command, verdict.committed_until};
  state.waiting_chunk.header = chunk.header;
  std::copy_n(chunk.values, chunk.value_count(), state.waiting_chunk.values);
}

void relieve(TickState& state, MonoTime now, const TickConfig& config) {
  if (state.waiting.command.sequence == 0 || (now < state.waiting.due && plays(state, now, config))) return;
  const CommandInUse command = state.waiting.command;
  take_over(state, state.waiting_chunk, command, now, config);
}

const CommandInUse& newest_command(const TickState& state) {
  return state.waiting.command.sequence != 0 ? state.waiting.command : state.command;
}

Arrival take_message(TickState& state, const PolicyMessage& message, MonoTime now, const TickConfig& config) {
  if (message.session != state.mode.policy_session) {
    state.mode.policy_session = message.session;
    state.counters.last_sequence = 0;
    state.mode.last_refusal = Arrival::none;
    state.join.delays.forget();
  }
  Arrival mailbox = Arrival::none;
  if (!is_there(message, mailbox)) return mailbox;
  const ExpectedPolicy expected = expected_in_charge(state, config);
  const ArrivalVerdict verdict = judge_arrival(
      *message.command, message.bytes, now,
      {expected, state.counters.last_sequence, newest_command(state), message.session, state.candidate.in_charge},
      state.memory, config, message.values);
  state.counters.integration_errors += verdict.stamps_ran_backwards ? 1U : 0U;
  if (verdict.arrival == Arrival::accepted) accept(state, *message.command, verdict, now, config);
  return verdict.arrival;
}

namespace {

// Nothing is promised while it plays, so that nothing of its waits.
Arrival take_fallback_message(TickState& state, const PolicyMessage& message, MonoTime now, const TickConfig& config) {
  FallbackState& fallback = state.fallback;
  if (message.session != fallback.session) {
    fallback.session = message.session;
    fallback.last_sequence = 0;
    fallback.last_refusal = Arrival::none;
  }
  Arrival mailbox = Arrival::none;
  if (!is_there(message, mailbox)) return mailbox;
  const ArrivalVerdict verdict =
      judge_arrival(*message.command, message.bytes, now,
                    {config.fallback_policy, fallback.last_sequence, fallback.command, message.session, 0},
                    state.memory, config, message.values);
  state.counters.integration_errors += verdict.stamps_ran_backwards ? 1U : 0U;
  if (verdict.arrival != Arrival::accepted) return verdict.arrival;
  if (fallback_plays(state, now, config))
    join_path(state.fallback_join, state.fallback_chunk, fallback.command.begins(),
              {*message.command, verdict.command.begins()}, now, config);
  else
    begin_path(state.fallback_join, state.fallback_chunk, *message.command);
  fallback.last_sequence = verdict.command.sequence;
  fallback.command = verdict.command;
  return verdict.arrival;
}

}  // namespace

// Its refusals are told, and stop nobody: it is not fresh then.
void judge_fallback(TickState& state, const TickInput& input, const TickConfig& config, FallbackRecord& record) {
  FallbackState& fallback = state.fallback;
  record.arrival = take_fallback_message(state, input.fallback, input.now, config);
  if (record.arrival != Arrival::none)
    fallback.last_refusal = is_refusal(record.arrival) ? record.arrival : Arrival::none;
  record.last_refusal = fallback.last_refusal;
  record.freshness = freshness_of(fallback.command, state.fallback_chunk.header, input.now, config.freshness);
  if (is_usable(record.freshness)) fallback.last_usable_at = input.now;
  if (record.freshness != Freshness::missing) record.age = fallback.command.age(input.now);
  record.command_sequence = fallback.command.sequence;
  record.observation_answered = fallback.command.observation_id;
}

void hand_over(TickState& state, Player to, MonoTime now, const TickConfig& config) {
  std::array<PathPoint, kMaxJoints> references;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const auto& [q, dq, ddq] = state.joints[j].reference;
    references[j] = {static_cast<float>(q), static_cast<float>(dq), static_cast<float>(ddq)};
  }
  const std::span<const PathPoint> joints(references.data(), config.joint_count);
  if (to == Player::fallback)
    return join_references(state.fallback_join, {state.fallback_chunk, state.fallback.command.begins()}, joints, now,
                           config);
  join_references(state.join, {state.chunk, state.command.begins()}, joints, now, config);
}

}  // namespace takt::pipeline
