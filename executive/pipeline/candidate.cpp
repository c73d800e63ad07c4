// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/candidate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "executive/pipeline/chunk_player.hpp"
#include "executive/pipeline/freshness.hpp"
#include "executive/pipeline/messages.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "executive/pipeline/reference_limits.hpp"

namespace takt::pipeline {
namespace {

constexpr InterventionMask kMotionLimits = bit(Intervention::velocity_limit) | bit(Intervention::acceleration_limit);

Freshness freshness_beside(const TickState& state, MonoTime now, const TickConfig& config) {
  return freshness_of(state.seats[Seat::candidate], now, config.freshness);
}

// More than half of what the contract allows.
bool is_used_up(std::uint32_t count, double allowed) {
  return 2.0 * count > allowed;
}

void end_probation(TickState& state) {
  state.candidate.probation_left = {};
  state.candidate_misses.restart();
  state.candidate_refusals.restart();
  state.candidate_clamped.restart();
}

// The two change places. What waits for its turn is dropped: it is of who leaves.
void change_places(TickState& state, std::uint64_t policy_hash, const TickConfig& config) {
  CandidateState& candidate = state.candidate;
  SeatState& policy = state.seats[Seat::policy];
  SeatState& beside = state.seats[Seat::candidate];
  std::swap(policy.session, beside.session);
  std::swap(policy.last_sequence, beside.last_sequence);
  std::swap(policy.last_refusal, beside.last_refusal);
  candidate.in_charge = candidate.in_charge == 0 ? 1 : 0;
  candidate.policy_hash = candidate.in_charge != 0 ? policy_hash : 0;
  beside.command = {};
  candidate.asked_at = {};
  state.waiting.command = {};
  policy.join.delays.forget();
  end_probation(state);
  if (candidate.in_charge != 0) candidate.probation_left = config.probation;
}

// The robot's own policy takes its place back in this very tick, and moves the robot if it has a fresh command; else
// nothing does.
void go_back(TickState& state, PolicyChange why, MonoTime now, const TickConfig& config, TickRecordHeader& header) {
  SeatRecord& told = header.seats[Seat::policy];
  SeatState& policy = state.seats[Seat::policy];
  const CommandInUse own = state.seats[Seat::candidate].command;
  const bool is_fresh = is_usable(freshness_beside(state, now, config));
  change_places(state, 0, config);
  state.misses.restart();  // they were the candidate's
  forget_misses(state.recovery);
  header.candidate.change = why;
  if (!is_fresh) {  // the candidate's last command leaves with it: nothing moves the robot meanwhile
    policy.command = {};
    told.freshness = Freshness::missing;
    note_freshness(state.recovery, told.freshness, now);
    return;
  }
  const bool was_played = is_usable(told.freshness);
  take_over(state, state.seats[Seat::candidate].chunk, own, now, config);
  if (!was_played) hand_over(state, Seat::policy, now, config);
  told.freshness = freshness_of(policy, now, config.freshness);
  note_freshness(state.recovery, told.freshness, now);
}

void hear_request(TickState& state, const TickInput& input, const TickConfig& config, PolicyChange& change) {
  CandidateState& candidate = state.candidate;
  const bool swaps = input.operator_request == OperatorRequest::swap;
  if (!swaps && input.operator_request != OperatorRequest::back) return;
  const bool can_swap = candidate.in_charge == 0 && input.candidate_policy != 0 &&
                        input.asked_policy == input.candidate_policy &&
                        is_usable(freshness_beside(state, input.now, config));
  const bool can_change = !is_latched(state.mode.mode) && (swaps ? can_swap : candidate.in_charge != 0);
  change = can_change ? PolicyChange::asked : PolicyChange::refused;
  if (can_change) candidate.asked_at = input.now;
}

Arrival take_candidate_message(TickState& state, const TickInput& input, const TickConfig& config,
                               PolicyChange& change) {
  CandidateState& candidate = state.candidate;
  SeatState& beside = state.seats[Seat::candidate];
  const PolicyMessage& message = input.messages[Seat::candidate];
  // The policy that was asked for is gone, and its successor was not asked for.
  if (message.session != beside.session && candidate.in_charge == 0 && candidate.asked_at.is_set()) {
    candidate.asked_at = {};
    change = PolicyChange::expired;
  }
  const ArrivalVerdict verdict =
      hear_policy(state, Seat::candidate, message, expected_beside(state, input, config), input.now, config);
  if (verdict.arrival != Arrival::accepted) return verdict.arrival;
  const bool takes_over =
      candidate.asked_at.is_set() && verdict.command.observation_id >= newest_command(state).observation_id;
  if (takes_over) {
    change_places(state, verdict.command.policy_hash, config);
    change = candidate.in_charge != 0 ? PolicyChange::swapped : PolicyChange::back;
    accept(state, *message.command, verdict, input.now, config);
    return verdict.arrival;
  }
  begin_or_join(beside, is_usable(freshness_beside(state, input.now, config)), *message.command, verdict.command,
                input.now, config);
  return verdict.arrival;
}

// What the contract leaves of its windows; none: probation goes on.
PolicyChange used_up(const TickState& state, const TickConfig& config) {
  const FreshnessContract& contract = config.freshness;
  if (is_used_up(state.candidate_misses.count(), contract.epsilon * contract.window_ticks))
    return PolicyChange::back_for_age;
  if (is_used_up(state.candidate_refusals.count(), contract.bad_command_limit)) return PolicyChange::back_for_refusals;
  if (is_used_up(state.candidate_clamped.count(), config.clamped_share * contract.window_ticks))
    return PolicyChange::back_for_range;
  return PolicyChange::none;
}

bool is_on_probation(const TickState& state) {
  return state.candidate.probation_left > Duration{};
}

}  // namespace

ExpectedPolicy expected_in_charge(const TickState& state, const TickConfig& config) {
  ExpectedPolicy expected = config.policy;
  if (state.candidate.in_charge != 0) expected.hash = state.candidate.policy_hash;
  return expected;
}

ExpectedPolicy expected_beside(const TickState& state, const TickInput& input, const TickConfig& config) {
  ExpectedPolicy expected = config.policy;
  if (state.candidate.in_charge == 0) expected.hash = input.candidate_policy;
  return expected;
}

void judge_candidate(TickState& state, const TickInput& input, const TickConfig& config, TickRecordHeader& header) {
  CandidateState& candidate = state.candidate;
  PolicyChange& change = header.candidate.change;
  hear_request(state, input, config, change);
  const Arrival arrival = take_candidate_message(state, input, config, change);
  header.seats[Seat::candidate].arrival = arrival;
  remember_refusal(state.seats[is_handover(change) ? Seat::policy : Seat::candidate], arrival);
  if (!candidate.asked_at.is_set() || input.now - candidate.asked_at <= config.freshness.stop_after) return;
  candidate.asked_at = {};
  change = PolicyChange::expired;
}

void watch_probation(TickState& state, const TickConfig& config, TickRecordHeader& header) {
  if (!is_on_probation(state) || state.mode.mode != Mode::tracking || is_handover(header.candidate.change)) return;
  const std::uint32_t window = config.freshness.window_ticks;
  const SeatRecord& policy = header.seats[Seat::policy];
  const bool refused = is_refusal(policy.arrival) && !is_refused_for_age(policy.arrival);
  state.candidate_misses.push(!is_usable(policy.freshness), window);
  state.candidate_refusals.push(refused, window);
  if (const PolicyChange why = used_up(state, config); why != PolicyChange::none)
    return go_back(state, why, header.now, config, header);
  if (!is_usable(policy.freshness)) return;
  state.candidate.probation_left = state.candidate.probation_left - config.period;
  if (is_on_probation(state)) return;
  end_probation(state);
  header.candidate.change = PolicyChange::confirmed;
}

bool roll_back(TickState& state, const TickConfig& config, TickRecordHeader& header) {
  if (header.previous_mode != Mode::tracking || !is_on_probation(state)) return false;
  go_back(state, PolicyChange::back_for_stop, header.now, config, header);
  return true;
}

void settle_candidate(TickState& state, const TickConfig& config, TickRecordHeader& header) {
  CandidateState& candidate = state.candidate;
  if (is_latched(header.mode) && candidate.asked_at.is_set()) {
    candidate.asked_at = {};
    header.candidate.change = PolicyChange::expired;
  }
  CandidateRecord& record = header.candidate;
  record.in_charge = candidate.in_charge;
  record.on_probation = is_on_probation(state) ? 1 : 0;
  record.is_asked = candidate.asked_at.is_set() ? 1 : 0;
  record_seat(state.seats[Seat::candidate], header.now, config, header.seats[Seat::candidate]);
}

void compare_candidate(TickState& state, const Choice& choice, std::span<const JointTarget> targets,
                       const TickConfig& config, TickRecord& record) {
  CandidateRecord& out = record.header.candidate;
  const bool plays = choice.player == Player::policy;
  if (plays && is_on_probation(state)) {
    const auto is_clamped = [](const JointTarget& target) { return target.out_of_range; };
    state.candidate_clamped.push(std::ranges::any_of(targets.first(config.joint_count), is_clamped),
                                 config.freshness.window_ticks);
  }
  const SeatState& beside = state.seats[Seat::candidate];
  if (!is_usable(record.header.seats[Seat::candidate].freshness)) {
    for (std::size_t j = 0; j < config.joint_count; ++j)
      state.joints[j].candidate_reference = state.joints[j].reference;
    return;
  }
  std::array<JointTarget, kMaxJoints> asked;  // uninitialised: play fills joint_count entries
  play(beside.join, {beside.chunk, beside.command.begins()}, record.header.now, config, asked);
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    JointState& joint = state.joints[j];
    if (asked[j].out_of_range) out.beyond_range |= bit_of_joint(j);
    if (!plays || config.joints[j].passive) {
      joint.candidate_reference = joint.reference;
      continue;
    }
    const JointLimits& limits = config.joints[j].limits;
    const ReferenceStep step = step_towards(joint.candidate_reference, asked[j].q, asked[j].dq, limits.velocity, limits,
                                            config.period.seconds());
    joint.candidate_reference = step.next;
    if ((step.interventions & kMotionLimits) != 0) out.beyond_limits |= bit_of_joint(j);
    out.distance = std::max(out.distance, std::abs(asked[j].q - targets[j].q) / limits.per_rad);
  }
}

}  // namespace takt::pipeline
