// SPDX-License-Identifier: Apache-2.0
// observe, estimate, judge: from what arrived to the mode of this tick.
#include <algorithm>
#include <array>
#include <cmath>

#include "executive/pipeline/brake.hpp"
#include "executive/pipeline/bus_watch.hpp"
#include "executive/pipeline/candidate.hpp"
#include "executive/pipeline/causes.hpp"
#include "executive/pipeline/choose.hpp"
#include "executive/pipeline/following.hpp"
#include "executive/pipeline/freshness.hpp"
#include "executive/pipeline/gravity_model.hpp"
#include "executive/pipeline/messages.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "executive/pipeline/stages.hpp"
#include "executive/pipeline/velocity_observer.hpp"

namespace takt::pipeline {
namespace {

// While degraded the fallback goes first. Where it has nothing to say, and the policy is back, but not for long enough
// yet, the policy is better than none.
// A stop by the fallback policy goes on moving a robot that its policies moved, all of it, and that nothing lets go.
bool stops_by_policy(const TickState& state, const TickRecordHeader& header, const TickConfig& config) {
  const bool begins = header.previous_mode == Mode::tracking || header.previous_mode == Mode::degraded;
  return (begins || state.mode.player == Player::fallback) && (state.mode.deenergised | state.mode.damped) == 0 &&
         manner_of(state, header.now, config) == StopManner::policy;
}

Player player_of(const TickState& state, const TickRecordHeader& header, const TickConfig& config) {
  const Player policy = is_usable(header.seats[Seat::policy].freshness) ? Player::policy : Player::none;
  const bool is_backed = has_fallback_policy(config) && is_usable(header.seats[Seat::fallback].freshness);
  switch (header.mode) {
    case Mode::standby:
    case Mode::arming:
    case Mode::fault_latched:
      return Player::none;
    case Mode::damped_stop:
      return is_backed && stops_by_policy(state, header, config) ? Player::fallback : Player::none;
    case Mode::tracking:
      return policy;
    case Mode::degraded:
      break;
  }
  if (has_fallback_policy(config)) return is_backed ? Player::fallback : policy;
  return config.degraded == DegradedBehaviour::slow ? policy : Player::none;
}

void forget_rest(ModeState& mode) {
  mode.rest.forget();
  mode.rest_of_all.forget();
  mode.resting = 0;
}

void choose_player(TickState& state, TickRecordHeader& header, const TickConfig& config) {
  const Player player = player_of(state, header, config);
  ModeState& mode = state.mode;
  if (player == Player::fallback && mode.player != player) state.fallback.plays_since = header.now;
  if (player != Player::fallback) state.fallback.plays_since = {};
  // Let go in a stop: what it stood still before is no rest.
  if (header.mode == Mode::damped_stop && mode.player == Player::fallback && player != Player::fallback) {
    forget_rest(mode);
  }
  if (player != Player::none) {
    if (mode.last_player != Player::none && mode.last_player != player)
      hand_over(state, *seat_of(player), header.now, config);
    mode.last_player = player;
  }
  header.player = mode.player = player;
}

void note_arrival(TickState& state, Arrival arrival, const FreshnessContract& contract) {
  const bool refused = is_refusal(arrival);
  state.refusals.push(refused && !is_refused_for_age(arrival), contract.window_ticks);
  state.counters.refused_commands += refused ? 1U : 0U;
  remember_refusal(state.seats[Seat::policy], arrival);
}

// Who is asked whether it rests: the joints that are heard and have power. The last velocity of the others may be all
// that they left behind.
JointMask asked_for_rest(const TickState& state, MonoTime now, const TickConfig& config) {
  const JointMask powered = every_joint(config.joint_count) & ~state.mode.deenergised & ~passive_joints(config);
  JointMask heard = 0;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    if (is_heard(state.joints[j].observer, now, config.feedback_timeout)) heard |= bit_of_joint(j);
  }
  return powered & heard;
}

// What sags keeps the others neither from resting nor from holding; their reset waits for it too.
void watch_for_rest(TickState& state, const TickRecord& record, const TickConfig& config) {
  ModeState& mode = state.mode;
  if (!is_latched(mode.mode)) return;
  const MonoTime now = record.header.now;
  const std::span joints(record.joints, config.joint_count);
  const JointMask asked = asked_for_rest(state, now, config);
  const JointMask can_hold = asked & ~mode.damped;
  const auto slow = [&config](std::size_t joint) { return rest_velocity_of(config, joint); };
  mode.rest.follow(now, joints, can_hold != 0 ? can_hold : asked, slow);
  mode.rest_of_all.follow(now, joints, asked, slow);
  // Whom the fallback policy moves may stand still now and then.
  if (mode.rest.rests(now) && mode.player != Player::fallback) mode.resting = 1;
}

// Only what is believed reaches the estimate.
void hear(TickState& state, std::size_t j, const TickInput& input, const TickConfig& config) {
  const JointConfig& joint = config.joints[j];
  ObserverState& observer = state.joints[j].observer;
  if (input.joints[j].refused != WireVerdict::allowed) note_untold(state.feedback[j]);
  const Belief belief = take_feedback(state.feedback[j], input.joints[j], input.now, joint, config);
  if (belief == Belief::begins) observer = {};
  const float bandwidth = config.without.observer ? kNoFilter : joint.observer_bandwidth;
  if (belief == Belief::none) return;
  take_reply(observer, input.joints[j], bandwidth);
  state.joints[j].stood_still = {};
}

// A drive that is asked nothing says nothing: while the loop itself stood still, that is no silence of the drive. One
// that follows positions or velocities by itself is not excused: it goes on by what it was told last.
void excuse_own_stall(TickState& state, MonoTime now, const TickConfig& config) {
  const MonoTime before = state.mode.ticked_at;
  state.mode.ticked_at = now;
  if (!before.is_set() || now - before < config.period * 2) return;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    JointState& joint = state.joints[j];
    if (!joint.observer.sampled_at.is_set() || !makes_torque_by_position(config.joints[j].loop)) continue;
    const Duration stood_still = now - std::max(before, joint.observer.sampled_at) - config.period;
    joint.stood_still = std::clamp(joint.stood_still + stood_still, joint.stood_still, kLongestExcuse);
  }
}

// Every period of the grid is a tick in time, a late one, or one that was skipped.
void count_periods(TickState& state, const TickInput& input, const TickConfig& config) {
  const std::uint32_t window = config.freshness.window_ticks;
  state.late.push_marked(input.skipped_periods - state.links.skipped_periods, window);
  state.late.push(input.lateness >= config.period, window);
}

void forget_commands(TickState& state) {
  for (SeatState& seat : state.seats.values) seat.command = {};
  state.waiting.command = {};
}

// The clock stood still while the computer slept: nothing from before has a known age any more.
void forget_what_was_before_sleep(TickState& state, MonoTime now, const TickConfig& config) {
  state.mode.awake_since = now;
  forget_commands(state);
  state.memory.forget();
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    state.joints[j].observer = {};
    forget_replies(state.feedback[j]);
    state.joints[j].tau_last = state.joints[j].tau_damping = 0.0F;
    state.joints[j].behind_since = {};
  }
}

// A drive that is given up gets no power until standby, whatever it says later. What hangs on it damps; the rest of its
// limb holds, each joint where it hears itself.
void take_out(TickState& state, JointMask joints) {
  state.mode.deenergised |= joints;
  state.mode.damped |= state.limbs.beyond(joints);
  state.mode.held |= state.limbs.of(joints);
}

// Of a robot without a model: nothing that a stop or a fault would damp to rest is known to get there.
void hold_at_once(TickState& state, const TickConfig& config) {
  if (!config.holds_at_once || !is_latched(state.mode.mode) || state.mode.player == Player::fallback) return;
  state.mode.held = every_joint(config.joint_count);
}

JointMask not_enabled(const TickRecord& record, const TickConfig& config) {
  JointMask mask = 0;
  for (std::size_t j = 0; j < config.joint_count; ++j)
    if (record.joints[j].feedback.drive_state != DriveState::enabled) mask |= bit_of_joint(j);
  return mask;
}

// A setpoint that never left is undone: torque and reference go on from what the drive was really told. What the guard
// sends instead of a refused frame drives nothing: torque begins anew.
void follow_what_was_sent(TickState& state, const TickInput& input, const TickConfig& config) {
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const bool refused = input.joints[j].refused != WireVerdict::allowed;
    if (!refused && (input.last_damped & bit_of_joint(j)) == 0) continue;
    state.joints[j].tau_last = refused ? 0.0F : state.joints[j].tau_damping;
    state.joints[j].reference = state.joints[j].reference_before;
  }
}

// A joint that is heard for the first time, or again after a sleep: a drive that follows positions would be led on from
// an estimate of 0.
void begin_where_heard(TickState& state, JointMask unknown, const TickConfig& config) {
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    JointState& joint = state.joints[j];
    if ((unknown & bit_of_joint(j)) != 0 && joint.observer.sampled_at.is_set())
      joint.reference = standing_at(joint.observer.q, config.joints[j].limits);
  }
}

// In the tick of a change of mode every drive is written to, and answers, in turn or not.
void excuse_out_of_turn(LinkWatch& links, const TickRecordHeader& header, const TickConfig& config) {
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    std::uint8_t& excused = links.joints[j].excused;
    if (!config.joints[j].turns.has(header.tick) && excused < 0xFF) ++excused;
  }
}

CauseMask causes_stopped_by(StopManner manner, const TickConfig& config) {
  CauseMask causes = 0;
  for (std::size_t i = 0; i < kCauseCount; ++i)
    if (config.stops[i].manner == manner) causes |= bit(static_cast<Cause>(i));
  return causes;
}

// In whose manner the damped stop goes on; Cause::none: damped to rest and held.
void follow_stop(TickState& state, const TickRecordHeader& header, const TickConfig& config) {
  ModeState& mode = state.mode;
  if (mode.mode != Mode::damped_stop) return;
  const bool begins = header.previous_mode != Mode::damped_stop;
  const CauseMask by_policy = causes_stopped_by(StopManner::policy, config);
  const Cause cause = stopped_by(begins ? header.cause : mode.stop_cause, header.causes_active, by_policy);
  if (!begins && cause == mode.stop_cause) return;
  // One by policy follows only another by policy (stopped_by): that is one stop, and its time is one.
  const bool goes_on = !begins && (by_policy & bit(cause)) != 0;
  mode.stop_cause = cause;
  if (!goes_on) mode.stopped_since = header.now;
}

// What the robot file wants told and nothing more.
CauseMask warnings(const TickConfig& config) {
  return (config.temperature_degrades ? 0 : bit(Cause::temperature_high)) |
         (config.following.then == FollowingReaction::warn ? bit(Cause::following_error) : 0);
}

// Fills causes_active.
Transition decide_now(const TickState& state, const TickConfig& config, TickRecord& record) {
  TickRecordHeader& header = record.header;
  header.causes_active = conditions(state, record, config);
  header.causes_active |= granted_request(state, record, header.causes_active, config);
  return decide(state.mode.mode, header.causes_active, warnings(config));
}

void remember_press(ModeState& mode, const TickRecordHeader& header) {
  const bool pressed = header.operator_request == OperatorRequest::press_stop;
  if (pressed && mode.mode != Mode::standby && !mode.stop_pressed_at.is_set()) mode.stop_pressed_at = header.now;
}

}  // namespace

void observe(TickState& state, const TickInput& input, const TickConfig& config, TickRecord& record) {
  record.header = TickRecordHeader{};
  TickRecordHeader& header = record.header;
  header.tick = input.tick;
  header.now = input.now;
  header.lateness = input.lateness;
  header.last_duration = input.last_duration;
  header.skipped_periods = input.skipped_periods;
  header.slept_ms = input.slept_ms;
  header.overrun_cause = input.overrun_cause;
  header.last_sent_at = input.last_sent_at;
  header.last_damped = input.last_damped;
  header.operator_request = input.operator_request;
  header.asked_at = input.asked_at;
  header.recorded_through = input.recorded_through;
  header.torque_output = input.torque_output;
  header.imu = input.imu;
  header.imu_verdict = take_imu(state.imu, input.imu, input.now, config);
  for (const Seat seat : kSeats) {
    const PolicyMessage& message = input.messages[seat];
    header.seats[seat].mailbox = message.mailbox;
    header.seats[seat].session = message.session;
    header.seats[seat].command_sequence_seen = sequence_seen(message);
  }
  header.candidate.policy_hash = input.candidate_policy;
  header.candidate.asked_policy = input.asked_policy;
  header.bus_count = static_cast<std::uint8_t>(config.bus_count);
  header.joint_count = config.joint_count;
  std::copy_n(input.buses, config.bus_count, header.buses);
  if (input.slept_ms != 0) forget_what_was_before_sleep(state, input.now, config);
  JointMask unknown = 0;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    record.joints[j] = JointRecord{};
    record.joints[j].feedback = input.joints[j];
    if (!state.joints[j].observer.sampled_at.is_set()) unknown |= bit_of_joint(j);
    if (input.joints[j].received_at > state.mode.awake_since) hear(state, j, input, config);
  }
  excuse_own_stall(state, input.now, config);
  follow_what_was_sent(state, input, config);
  begin_where_heard(state, unknown, config);
  count_periods(state, input, config);
  watch_links(state.links, config, record);
  if (input.operator_request == OperatorRequest::reset && state.mode.mode == Mode::standby)
    for (std::size_t j = 0; j < config.joint_count; ++j) accept_place(state.feedback[j]);
  for (std::size_t j = 0; j < config.joint_count; ++j)
    record.joints[j].reply_faults = static_cast<ReplyFaultMask>(
        record.joints[j].reply_faults | feedback_faults(state.feedback[j], input.joints[j], input.now, config));
}

namespace {

void add_gravity(const GravityModel& model, const TickConfig& config, TickRecord& record) {
  std::array<float, kMaxJoints> q, torques;
  for (std::size_t j = 0; j < config.joint_count; ++j) q[j] = record.joints[j].q_estimate;
  model.torques(q, torques);
  for (std::size_t j = 0; j < config.joint_count; ++j) record.joints[j].tau_gravity = torques[j];
}

}  // namespace

void estimate(TickState& state, const TickConfig& config, TickRecord& record) {
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const JointMotion now = estimate_at(state.joints[j].observer, record.header.now, config.feedback_timeout);
    record.joints[j].q_estimate = now.q;
    record.joints[j].dq_estimate = now.dq;
  }
  watch_following(state, config, record);
  if (config.gravity_compensation) add_gravity(state.gravity, config, record);
  std::array<Rates, kMaxJoints> rates;
  find_rates(record, state.scarce, state.gravity, config, rates);
  for (std::size_t j = 0; j < config.joint_count; ++j) state.joints[j].rates = rates[j];
}

void judge(TickState& state, const TickInput& input, const TickConfig& config, TickRecord& record) {
  const FreshnessContract& contract = config.freshness;
  TickRecordHeader& header = record.header;
  SeatRecord& policy = header.seats[Seat::policy];
  policy.arrival = take_message(state, input.messages[Seat::policy], input.now, config);
  note_arrival(state, policy.arrival, contract);
  judge_candidate(state, input, config, header);
  relieve(state, input.now, config);
  policy.freshness = freshness_of(state.seats[Seat::policy], input.now, contract);
  note_freshness(state.recovery, policy.freshness, input.now);
  if (has_fallback_policy(config)) judge_fallback(state, input, config, header.seats[Seat::fallback]);
  if (state.mode.mode == Mode::tracking || state.mode.mode == Mode::degraded) {
    const bool missed = !is_usable(policy.freshness);
    state.misses.push(missed, contract.window_ticks);
    note_miss(state.recovery, missed, contract);
  }
  watch_probation(state, config, header);
  watch_for_rest(state, record, config);

  header.mode = header.previous_mode = state.mode.mode;
  Transition transition = decide_now(state, config, record);
  // Back to the configured policy before the mode is decided: what the candidate lacks is no reason then.
  if (transition.to != header.previous_mode && roll_back(state, config, header))
    transition = decide_now(state, config, record);
  header.cause = transition.cause;
  header.mode = transition.to;
  const JointMask affected = affected_joints(state, record, config);  // by the mode that is left
  const bool stops_arming = header.previous_mode == Mode::arming && header.mode == Mode::damped_stop;
  if (transition.cause != Cause::none) {
    enter(state, transition.to, input.now, contract);
    if (transition.to == Mode::standby) policy.freshness = header.seats[Seat::fallback].freshness = Freshness::missing;
    excuse_out_of_turn(state.links, header, config);
  }
  follow_stop(state, header, config);
  // Who stops the arming does not want the drives that are still off.
  if (stops_arming) take_out(state, affected & not_enabled(record, config));
  if (state.mode.mode == Mode::fault_latched) {
    take_out(state, affected);
    // A fault of ours: no model is trusted any more.
    if ((header.causes_active & bit(Cause::internal_error)) != 0) state.mode.damped = every_joint(config.joint_count);
  }
  remember_press(state.mode, header);
  settle_candidate(state, config, header);
  choose_player(state, header, config);
  hold_at_once(state, config);
}

namespace {

// Whatever answers an observation of before a reset or an arming knows nothing of what the robot is there for now.
void begin_epoch(TickState& state) {
  state.memory.forget();
  state.waiting.command = {};
}

}  // namespace

void enter(TickState& state, Mode mode, MonoTime now, const FreshnessContract& contract) {
  const Mode left = state.mode.mode;
  state.mode.mode = mode;
  state.mode.degraded_since = mode == Mode::degraded ? now : MonoTime{};
  switch (mode) {
    case Mode::standby:
      state.mode.drives_enabled = 0;
      state.mode.deenergised = state.mode.damped = state.mode.held = 0;
      state.mode.stop_pressed_at = {};
      state.mode.last_player = Player::none;
      begin_epoch(state);
      forget_commands(state);
      return;
    case Mode::arming:
      begin_epoch(state);
      state.mode.last_player = Player::none;
      state.mode.armed_at = now;
      state.recovery.restored_at = {};
      state.recovery.relapses = 0;
      return;
    case Mode::tracking:
      state.mode.drives_enabled = 1;
      state.mode.resumed_at = now;
      state.misses.restart();
      forget_misses(state.recovery);
      if (left == Mode::degraded) note_restored(state.recovery, now);
      return;
    case Mode::degraded:
      note_degraded(state.recovery, now, contract);
      return;
    case Mode::damped_stop:
    case Mode::fault_latched:
      forget_rest(state.mode);
      return;
  }
}

}  // namespace takt::pipeline
