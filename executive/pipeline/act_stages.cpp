// SPDX-License-Identifier: Apache-2.0
// constrain, stabilise, clamp_output, publish, record: from what is asked to what leaves.
#include <algorithm>
#include <array>
#include <limits>

#include "executive/pipeline/brake.hpp"
#include "executive/pipeline/candidate.hpp"
#include "executive/pipeline/envelope.hpp"
#include "executive/pipeline/freshness.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "executive/pipeline/reference_limits.hpp"
#include "executive/pipeline/stabiliser.hpp"
#include "executive/pipeline/stages.hpp"

namespace takt::pipeline {
namespace {

bool plays_held(const Choice& choice, const JointConfig& joint, const TickConfig& config) {
  return plays_held_targets(config, joint) && choice.player != Player::none;
}

// Every reference that pulls begins near its joint.
ReferenceState near_joint(const JointState& joint, const JointTarget& target, const JointRecord& measured,
                          const Choice& choice, const JointConfig& config, const TickConfig& robot) {
  const float kp = std::min(target.kp, config.limits.kp_max);
  const double dt = robot.period.seconds();
  ReferenceState from =
      kept_near(joint.reference, measured.q_estimate, measured.dq_estimate, kp, joint.kp_before, config.limits, dt);
  const bool begins = choice.reference == Reference::brake && joint.braked_before == 0;
  // A target that is held may be far from its joint on purpose: the distance is the torque that carries the robot.
  if (begins && !plays_held_targets(robot, config))
    return begin_of_braking(from, measured.q_estimate, measured.dq_estimate, kp, config.inertia, config.limits, dt);
  return from;
}

ReferenceStep next_reference(const JointState& joint, const JointTarget& target, const JointRecord& measured,
                             const Choice& choice, Reference how, const JointConfig& config, const TickConfig& robot) {
  const JointLimits& limits = config.limits;
  const double dt = robot.period.seconds();
  const bool pulls = target.kp > 0.0F && !choice.limp;
  switch (how) {
    case Reference::follow_measured:
      return {standing_at(measured.q_estimate, limits), 0};
    case Reference::move_with_measured:
      return {moving_with(measured.q_estimate, measured.dq_estimate, limits, dt), 0};
    case Reference::brake:
      if (!pulls) return step_with_measured(joint.reference, measured.q_estimate, 0.0F, target.speed, limits, dt);
      return step_braking(near_joint(joint, target, measured, choice, config, robot), limits, dt, joint.brake);
    case Reference::follow_target:
      if (!pulls) return step_with_measured(joint.reference, measured.q_estimate, target.dq, target.speed, limits, dt);
      const ReferenceState from = near_joint(joint, target, measured, choice, config, robot);
      if (plays_held(choice, config, robot)) return step_to_held(from, target.q, target.speed, limits, dt);
      return step_towards(from, target.q, target.dq, target.speed, limits, dt, joint.rates, !robot.without.jerk);
  }
  return {joint.reference, 0};
}

Reference reference_of(const Choice& choice, const JointTarget& target, const JointConfig& joint) {
  if (target.part == Part::holds && !joint.passive) return Reference::brake;
  const bool follows = joint.passive || target.part != Part::as_chosen;
  return follows ? Reference::follow_measured : choice.reference;
}

// rad/s^2, what torque leaves to slow down a joint that moves with dq; never next to nothing, for it has to end.
double rate_against(double dq, const Rates& rates, const JointLimits& limits) {
  constexpr double kLeast = 0.1;  // of limits.acceleration
  return std::max(dq > 0.0 ? rates.down : rates.up, kLeast * static_cast<double>(limits.acceleration));
}

// A joint that begins to hold does so from its measured motion.
void begin_to_hold(TickState& state, std::span<const JointTarget> targets, const TickConfig& config,
                   const TickRecord& record) {
  JointMask holding = 0;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    if (targets[j].part != Part::holds) continue;
    holding |= bit_of_joint(j);
    if ((state.mode.holding & bit_of_joint(j)) != 0) continue;
    const JointRecord& measured = record.joints[j];
    JointState& joint = state.joints[j];
    joint.reference =
        moving_with(measured.q_estimate, measured.dq_estimate, config.joints[j].limits, config.period.seconds());
    joint.brake = std::numeric_limits<double>::infinity();
  }
  state.mode.holding = holding;
}

// No step is committed from which the robot could not be stopped: then all that follow a reference brake as they were
// known to be able to, without what the policy wanted on top.
void keep_brake(TickState& state, const Choice& choice, std::span<JointTarget> targets, std::span<ReferenceStep> steps,
                const TickConfig& config, const TickRecord& record) {
  std::array<Stopping, kMaxJoints> stops;  // joint_count entries are used
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const JointRecord& measured = record.joints[j];
    const Reference how = reference_of(choice, targets[j], config.joints[j]);
    const bool follows = how == Reference::follow_target || how == Reference::brake;
    ReferenceState at{static_cast<double>(measured.q_estimate), static_cast<double>(measured.dq_estimate)};
    if (follows && targets[j].kp > 0.0F) at = {steps[j].next.q, steps[j].next.dq};  // without stiffness: the joint
    stops[j] = {at, 0.0, follows};
  }
  const bool stoppable = can_stop(stops, record, state.scarce, state.gravity, config);
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    JointState& joint = state.joints[j];
    const JointConfig& limits = config.joints[j];
    if (stoppable || !stops[j].is_braked) {
      joint.brake = stops[j].deceleration;
      continue;
    }
    // A reference that was brought near its joint has no stop that was known before: what torque leaves now is its.
    const bool pulls = targets[j].kp > 0.0F;
    if (pulls && near_joint(joint, targets[j], record.joints[j], choice, limits, config).dq != joint.reference.dq)
      joint.brake = std::min(joint.brake, rate_against(stops[j].from.dq, joint.rates, limits.limits));
    const ReferenceStep braked =
        next_reference(joint, targets[j], record.joints[j], choice, Reference::brake, limits, config);
    const bool differs = braked.next.dq != steps[j].next.dq;
    steps[j] = braked;
    if (differs) steps[j].interventions |= bit(Intervention::brake_reserve);
    targets[j].tau_ff = targets[j].dq_held = 0.0F;
    targets[j].kd = std::max(targets[j].kd, limits.damping);
  }
}

// How far out the barriers leave a joint alone: where it is while no command moves it, else its reference,
// which comes back at the pace of the limits.
float may_stay_at(const Choice& choice, Part part, const JointRecord& joint) {
  const bool follows = part == Part::as_chosen ? choice.reference == Reference::follow_measured : part != Part::holds;
  return follows ? joint.q_estimate : joint.q_reference;
}

// Without a player a motion only slows down, or goes to a pose at less than the limit.
float speed_barrier(const Choice& choice, const JointLimits& limits) {
  return choice.player == Player::none ? limits.velocity : speed_barrier_of_play(limits);
}

// Our own arithmetic failed: nothing leaves, and references restart from what is measured. Afterwards the whole robot
// damps: no model is trusted any more.
void stop_for_internal_error(TickState& state, const TickConfig& config, TickOutput& output) {
  TickRecordHeader& header = output.record.header;
  header.causes_active |= bit(Cause::internal_error);
  const Transition transition = decide(state.mode.mode, bit(Cause::internal_error));
  if (transition.cause != Cause::none) {
    enter(state, transition.to, header.now, config.freshness);
    header.mode = transition.to;
    header.cause = transition.cause;
  }
  if (state.mode.mode == Mode::fault_latched) state.mode.damped = every_joint(config.joint_count);
  header.player = state.mode.player = Player::none;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    output.setpoints[j] = output.damping[j] = {};
    state.joints[j].tau_damping = 0.0F;
    output.record.joints[j].tau_total = 0.0F;
    state.joints[j].reference = {};
  }
}

// As in fault_latched: no stiffness, no gravity model, and no torque but what the slew limit asks for. A drive that
// follows positions with gains of its own stays where it was told to be last: everything else would be a jump. Since a
// sleep it was told nothing until its joint is heard: no stiffness, so that it stays where the drive knows it.
JointSetpoint damping_of(const JointRecord& joint, const JointState& state, const JointConfig& config, float dt) {
  if (config.loop == LoopAt::drive_position) {
    const bool is_known = state.observer.sampled_at.is_set();
    return {static_cast<float>(state.reference_before.q), 0.0F, is_known ? config.kp : 0.0F,
            is_known ? config.kd : 0.0F, 0.0F};
  }
  const float tau_last = state.tau_last;
  const float q = std::clamp(joint.q_estimate, config.limits.q_min, config.limits.q_max);
  return stabilise_joint(
             {{q, 0.0F}, {joint.q_estimate, joint.dq_estimate}, 0.0F, config.damping, 0.0F, 0.0F, tau_last, false},
             config, dt)
      .setpoint;
}

}  // namespace

void constrain(TickState& state, const Choice& choice, std::span<JointTarget> targets, const TickConfig& config,
               TickRecord& record) {
  bool clamped = false;
  std::array<ReferenceStep, kMaxJoints> steps;  // joint_count entries are used
  begin_to_hold(state, targets, config, record);
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const JointRecord& measured = record.joints[j];
    const Reference how = reference_of(choice, targets[j], config.joints[j]);
    steps[j] = next_reference(state.joints[j], targets[j], measured, choice, how, config.joints[j], config);
  }
  if (state.scarce != 0) keep_brake(state, choice, targets, steps, config, record);
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    JointState& joint = state.joints[j];
    JointRecord& out = record.joints[j];
    const ReferenceStep& step = steps[j];
    joint.reference_before = joint.reference;
    joint.reference = step.next;
    joint.kp_before = choice.limp ? 0.0F : std::min(targets[j].kp, config.joints[j].limits.kp_max);
    joint.braked_before = reference_of(choice, targets[j], config.joints[j]) == Reference::brake ? 1 : 0;
    out.q_reference = static_cast<float>(step.next.q);
    out.dq_reference = static_cast<float>(step.next.dq);
    out.interventions = step.interventions;
    if (targets[j].out_of_range) {
      out.interventions = static_cast<InterventionMask>(out.interventions | bit(Intervention::target_range));
      clamped = true;
    }
  }
  const Player player = record.header.player;
  state.clamped.push(clamped && player != Player::fallback, config.freshness.window_ticks);
  state.fallback_clamped.push(clamped && player == Player::fallback, config.freshness.window_ticks);
  compare_candidate(state, choice, targets, config, record);
}

void stabilise(const TickState& state, const Choice& choice, std::span<const JointTarget> targets,
               const TickConfig& config, TickOutput& output) {
  const float dt = period_seconds(config);
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    JointRecord& joint = output.record.joints[j];
    const Part part = targets[j].part;
    if (choice.limp || config.joints[j].passive || part == Part::deenergised) {
      output.setpoints[j] = output.damping[j] = {joint.q_reference, 0.0F, 0.0F, 0.0F, 0.0F};
      continue;
    }
    output.damping[j] = damping_of(joint, state.joints[j], config.joints[j], dt);
    if (makes_torque_by_position(config.joints[j].loop)) {
      // Not heard, be it by a stall of ours: the drive damps by its own velocity, and is pushed by nothing.
      if (!is_heard(state.joints[j].observer, output.record.header.now, config.feedback_timeout)) {
        output.setpoints[j] = {output.damping[j].q, 0.0F, 0.0F, output.damping[j].kd, 0.0F};
        continue;
      }
      // In doubt where it is: no torque that rests on a position.
      if (state.feedback[j].in_doubt != 0) {
        output.setpoints[j] = output.damping[j];
        continue;
      }
    }
    const float dq = choice.moving_setpoint ? joint.dq_reference : targets[j].dq_held;
    const StabiliserOutput stable = stabilise_joint({{joint.q_reference, dq},
                                                     {joint.q_estimate, joint.dq_estimate},
                                                     targets[j].kp,
                                                     targets[j].kd,
                                                     targets[j].tau_ff,
                                                     choice.gravity && part != Part::damped ? joint.tau_gravity : 0.0F,
                                                     state.joints[j].tau_last,
                                                     choice.barriers && part != Part::damped,
                                                     may_stay_at(choice, part, joint),
                                                     state.joints[j].rates,
                                                     speed_barrier(choice, config.joints[j].limits)},
                                                    config.joints[j], dt);
    output.setpoints[j] = stable.setpoint;
    joint.interventions = static_cast<InterventionMask>(joint.interventions | stable.interventions);
  }
}

void clamp_output(TickState& state, const TickConfig& config, TickOutput& output) {
  bool finite = true;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    JointRecord& joint = output.record.joints[j];
    switch (clamp_to_envelope(output.setpoints[j], joint.tau_total, joint.q_estimate, joint.dq_estimate,
                              config.joints[j].limits)) {
      case EnvelopeVerdict::inside:
        break;
      case EnvelopeVerdict::clamped:
        joint.interventions = static_cast<InterventionMask>(joint.interventions | bit(Intervention::envelope_clamp));
        break;
      case EnvelopeVerdict::not_finite:
        joint.interventions = static_cast<InterventionMask>(joint.interventions | bit(Intervention::envelope_clamp));
        finite = false;
        break;
    }
    // Not finite where the setpoint is: its torque rests on the same estimate and the same last torque.
    (void)clamp_to_envelope(output.damping[j], state.joints[j].tau_damping, joint.q_estimate, joint.dq_estimate,
                            config.joints[j].limits);
  }
  if (!finite) stop_for_internal_error(state, config, output);
}

namespace {

bool is_of_this_session(const TickState& state) {
  const SeatState& policy = state.seats[Seat::policy];
  return policy.command.session == policy.session;
}

// How much of the path in use will be played whatever answers this observation. Of two observations that promise
// differently a policy may answer one only: it ends before the next is published, or the policy waits for its answer.
Duration promised(const TickState& state, const Choice& choice, MonoTime now, const TickConfig& config) {
  if (config.join.kind != JoinKind::prefix || choice.player != Player::policy || !is_of_this_session(state)) return {};
  const Duration delay = state.seats[Seat::policy].join.delays.longest(now);
  return delay > Duration{} ? std::min(delay, config.join.longest_delay) : config.join.longest_delay;
}

void commit(const TickState& state, const Choice& choice, MonoTime until, Observation& observation) {
  const SeatState& policy = state.seats[Seat::policy];
  observation.command_sequence = is_of_this_session(state) ? policy.command.sequence : 0;
  observation.of_candidate = policy.command.of_candidate;
  observation.committed_from = choice.player == Player::policy ? choice.step : 0;
  observation.committed_count = 0;
  if (!until.is_set()) return;
  const CommandHeader& header = policy.chunk.header;
  const std::int64_t period = header.step_period.ns;
  const std::int64_t end = ((until - policy.command.begins()).ns + period - 1) / period;
  observation.committed_count =
      static_cast<std::uint32_t>(std::clamp<std::int64_t>(end, choice.step, header.step_count) - choice.step);
}

}  // namespace

void publish(TickState& state, const Choice& choice, const TickConfig& config, TickOutput& output) {
  TickRecordHeader& header = output.record.header;
  output.observation_due = false;
  const std::uint64_t ordinal = header.tick / std::max<std::uint32_t>(config.observation_every_ticks, 1);
  if (ordinal < state.counters.next_observation_ordinal) return;
  MonoTime oldest = header.now;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const MonoTime sampled_at = state.joints[j].observer.sampled_at;
    if (!sampled_at.is_set()) return;  // a joint that never replied: there is nothing to observe yet
    oldest = std::min(oldest, sampled_at);
  }
  if (config.imu.present) {
    if (state.imu.in_force.sequence == 0) return;
    oldest = std::min(oldest, state.imu.in_force.sensed_at);
  }
  state.counters.next_observation_ordinal = ordinal + 1;
  Observation& observation = output.observation;
  const Duration promise = promised(state, choice, header.now, config);
  const MonoTime until = promise > Duration{} ? header.now + promise : MonoTime{};
  observation.id = header.observation_published =
      state.memory.remember({oldest, header.now, until}, state.shape.remembered);
  commit(state, choice, until, observation);
  observation.tick = header.tick;
  observation.oldest_sensed_at = oldest;
  observation.published_at = header.now;
  observation.period = config.period * std::max<std::uint32_t>(config.observation_every_ticks, 1);
  observation.imu = state.imu.in_force;
  observation.joint_count = config.joint_count;
  observation.mode = static_cast<std::uint8_t>(state.mode.mode);
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const JointRecord& joint = output.record.joints[j];
    observation.q[j] = joint.q_estimate;
    observation.dq[j] = joint.dq_estimate;
    observation.dq_of_drive[j] = joint.feedback.dq;
    observation.tau[j] = joint.feedback.tau;
    observation.q_setpoint[j] = output.setpoints[j].q;
  }
  output.observation_due = true;
}

namespace {

MonoTime valid_until(const TickState& state, Player player, const FreshnessContract& contract) {
  const std::optional<Seat> plays = seat_of(player);
  if (!plays) return {};
  const SeatState& seat = state.seats[*plays];
  return valid_until(seat.command, seat.chunk.header, contract);
}

// The robot's torque, by an output of its own. It cannot take a joint's alone.
bool permits_torque(const ModeState& mode, const TickConfig& config) {
  if (!config.has_torque_output || mode.mode == Mode::standby) return false;
  const bool took_power = mode.mode == Mode::fault_latched && mode.deenergised != 0;
  return !(took_power && config.joint_fault_takes_torque);
}

}  // namespace

void record(TickState& state, const Choice& choice, const TickConfig& config, TickOutput& output) {
  TickRecordHeader& header = output.record.header;
  const SeatState& policy = state.seats[Seat::policy];
  SeatRecord& told = header.seats[Seat::policy];
  if (told.freshness != Freshness::missing) header.age = policy.command.age_parts(header.now);
  told.age = header.age.total();
  told.command_sequence = policy.command.sequence;
  told.observation_answered = policy.command.observation_id;
  told.last_refusal = policy.last_refusal;
  header.command_policy = policy.command.policy_hash;
  header.window_misses = state.misses.count();
  header.window_ticks = state.misses.seen();
  header.integration_errors = state.counters.integration_errors;
  header.refused_commands = state.counters.refused_commands;
  header.chunk_step = choice.step;
  output.drives_enabled = state.mode.mode != Mode::standby;
  header.drives_enabled = output.drives_enabled ? 1 : 0;
  output.torque_permitted = permits_torque(state.mode, config);
  header.torque_permitted = output.torque_permitted ? 1 : 0;
  output.valid_until = valid_until(state, choice.player, config.freshness);
  const MonoTime next_tick = header.now + config.period;
  output.send_by = choice.player != Player::none ? std::min(next_tick, output.valid_until) : next_tick;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    JointRecord& joint = output.record.joints[j];
    const JointSetpoint& setpoint = output.setpoints[j];
    output.drive_enabled[j] = output.drives_enabled && (state.mode.deenergised & bit_of_joint(j)) == 0;
    joint.drive_enabled = output.drive_enabled[j] ? 1 : 0;
    joint.q_command = setpoint.q;
    joint.dq_command = setpoint.dq;
    joint.kp_command = setpoint.kp;
    joint.kd_command = setpoint.kd;
    joint.tau_command = setpoint.tau;
    // A drive that is not enabled yet makes no torque: its first one begins from none, whatever the others carry
    // already.
    const bool makes_torque = joint.feedback.drive_state == DriveState::enabled;
    state.joints[j].tau_last = makes_torque ? joint.tau_total : 0.0F;
    if (!makes_torque) state.joints[j].tau_damping = 0.0F;
    if (makes_torque)
      note_told(state.feedback[j], setpoint, joint.tau_gravity, joint.q_reference, config.joints[j]);
    else
      note_untold(state.feedback[j]);
  }
}

}  // namespace takt::pipeline
