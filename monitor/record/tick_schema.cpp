// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/tick_schema.hpp"

#include <array>

#include "executive/contract/feedback_names.hpp"

namespace takt::monitor {
namespace {

using enum FieldType;
constexpr FieldRole in = FieldRole::input;
constexpr FieldRole out = FieldRole::output;

// Names of an enum's values in order, from its own name() function.
template <class Enum, std::size_t count>
constexpr std::array<std::string_view, count> names_of() {
  std::array<std::string_view, count> names{};
  for (std::size_t value = 0; value < count; ++value) names[value] = name(static_cast<Enum>(value));
  return names;
}

constexpr auto kModes = names_of<Mode, kModeCount>();
constexpr auto kCauses = names_of<Cause, kCauseCount>();
constexpr auto kArrivals = names_of<Arrival, kArrivalCount>();
constexpr auto kFreshnesses = names_of<Freshness, kFreshnessCount>();
constexpr auto kPlayers = names_of<Player, kPlayerCount>();
constexpr auto kImuVerdicts = names_of<ImuVerdict, kImuVerdictCount>();
constexpr auto kOverruns = names_of<OverrunCause, kOverrunCauseCount>();
constexpr auto kPolicyChanges = names_of<PolicyChange, kPolicyChangeCount>();
constexpr std::array<std::string_view, kOperatorRequestCount> kRequests{
    "none", "arm", "stop", "reset", "shutdown", "mark", "press_stop", "deenergise", "swap", "back"};

#define HEADER(member) offsetof(TickRecordHeader, member)
#define SEAT(seat, member) \
  HEADER(seats) + static_cast<std::size_t>(Seat::seat) * sizeof(SeatRecord) + offsetof(SeatRecord, member)
#define CANDIDATE(member) HEADER(candidate) + offsetof(CandidateRecord, member)
#define IMU(member, axis) HEADER(imu) + offsetof(ImuSample, member) + sizeof(float) * (axis)
constexpr TickField kHeaderFields[] = {
    {"tick", u64, HEADER(tick), in, "control period counter"},
    {"now", i64, HEADER(now), in, "ns, CLOCK_MONOTONIC"},
    {"lateness", i64, HEADER(lateness), in, "ns, wake-up after its schedule"},
    {"last_duration", i64, HEADER(last_duration), in, "ns, work of the previous tick"},
    {"skipped_periods", u64, HEADER(skipped_periods), in, "since start"},
    {"last_sent_at", i64, HEADER(last_sent_at), in, "ns, just before the previous tick's first frame; 0: none"},
    {"last_damped", u64, HEADER(last_damped), in, "bit per joint: the previous tick came too late, and damped it"},
    {"asked_at", i64, HEADER(asked_at), in, "ns, when the executive heard the stop or shutdown; 0: neither"},
    {"command_sequence_seen", u64, SEAT(policy, command_sequence_seen), in, "of the message read; 0 none"},
    {"recorded_through", u64, HEADER(recorded_through), in, "newest tick on the recorder's medium; 0: nothing records"},
    {"operator_request", u8, HEADER(operator_request), in, "", kRequests},
    {"overrun_cause", u8, HEADER(overrun_cause), in, "of the previous period", kOverruns},
    {"mailbox", u8, SEAT(policy, mailbox), in, "ARRIVAL values; accepted: a message was read"},
    {"bus_count", u8, HEADER(bus_count), in, ""},
    {"joint_count", u32, HEADER(joint_count), in, ""},
    {"age", i64, SEAT(policy, age), out, "ns, of the command in use; 0 while freshness is missing"},
    {"age_sense", i64, HEADER(age) + offsetof(AgeParts, sense), out, "ns"},
    {"age_queue", i64, HEADER(age) + offsetof(AgeParts, queue), out, "ns"},
    {"age_infer", i64, HEADER(age) + offsetof(AgeParts, infer), out, "ns"},
    {"age_publish", i64, HEADER(age) + offsetof(AgeParts, publish), out, "ns"},
    {"age_hold", i64, HEADER(age) + offsetof(AgeParts, hold), out, "ns"},
    {"command_sequence", u64, SEAT(policy, command_sequence), out, "command in use; 0 none"},
    {"observation_answered", u64, SEAT(policy, observation_answered), out, ""},
    {"observation_published", u64, HEADER(observation_published), out, "0 none"},
    {"window_misses", u32, HEADER(window_misses), out, "exact count over the sliding window"},
    {"window_ticks", u32, HEADER(window_ticks), out, ""},
    {"integration_errors", u32, HEADER(integration_errors), out, "stamps that ran backwards, since start"},
    {"refused_commands", u32, HEADER(refused_commands), out, "since start"},
    {"mode", u8, HEADER(mode), out, "after this tick", kModes},
    {"previous_mode", u8, HEADER(previous_mode), out, "MODE values"},
    {"cause", u8, HEADER(cause), out, "of the transition, if any", kCauses},
    {"arrival", u8, SEAT(policy, arrival), out, "verdict on the message read", kArrivals},
    {"freshness", u8, SEAT(policy, freshness), out, "of the command in use", kFreshnesses},
    {"chunk_step", u8, HEADER(chunk_step), out, "step being played"},
    {"drives_enabled", u8, HEADER(drives_enabled), out, "1: drives are told to be enabled"},
    {"policy_session", u8, SEAT(policy, session), in, "changes when another policy's mailbox is read"},
    {"causes_active", u64, HEADER(causes_active), out, "bit per CAUSE value"},
    {"slept_ms", u32, HEADER(slept_ms), in, "the computer was suspended this long since the tick before"},
    {"last_refusal", u8, SEAT(policy, last_refusal), out, "ARRIVAL values; of the newest message, none: accepted"},
    {"torque_output", u8, HEADER(torque_output), in, "the output that permits torque", kTorqueOutputStateNames},
    {"imu_sequence", u64, HEADER(imu) + offsetof(ImuSample, sequence), in, "of the base's IMU, as read; 0: none yet"},
    {"imu_sensed_at", i64, HEADER(imu) + offsetof(ImuSample, sensed_at), in, "ns, CLOCK_MONOTONIC"},
    {"imu_rotation_w", f32, IMU(rotation, 0), in, "base in world, unit quaternion"},
    {"imu_rotation_x", f32, IMU(rotation, 1), in, ""},
    {"imu_rotation_y", f32, IMU(rotation, 2), in, ""},
    {"imu_rotation_z", f32, IMU(rotation, 3), in, ""},
    {"imu_angular_velocity_x", f32, IMU(angular_velocity, 0), in, "rad/s, base frame"},
    {"imu_angular_velocity_y", f32, IMU(angular_velocity, 1), in, "rad/s, base frame"},
    {"imu_angular_velocity_z", f32, IMU(angular_velocity, 2), in, "rad/s, base frame"},
    {"imu_acceleration_x", f32, IMU(acceleration, 0), in, "m/s^2, base frame, specific force"},
    {"imu_acceleration_y", f32, IMU(acceleration, 1), in, "m/s^2, base frame, specific force"},
    {"imu_acceleration_z", f32, IMU(acceleration, 2), in, "m/s^2, base frame, specific force"},
    {"imu_verdict", u8, HEADER(imu_verdict), out, "on that sample", kImuVerdicts},
    {"torque_permitted", u8, HEADER(torque_permitted), out, "1: that output is told to permit torque"},
    {"player", u8, HEADER(player), out, "whose chunk the robot follows", kPlayers},
    {"fallback_command_sequence_seen", u64, SEAT(fallback, command_sequence_seen), in,
     "of the fallback policy's message; 0 none"},
    {"fallback_age", i64, SEAT(fallback, age), out, "ns, of the fallback policy's command in use"},
    {"fallback_command_sequence", u64, SEAT(fallback, command_sequence), out, "in use; 0 none"},
    {"fallback_observation_answered", u64, SEAT(fallback, observation_answered), out, ""},
    {"fallback_mailbox", u8, SEAT(fallback, mailbox), in, "ARRIVAL values; accepted: a message was read"},
    {"fallback_session", u8, SEAT(fallback, session), in, "changes when another fallback policy's mailbox is read"},
    {"fallback_arrival", u8, SEAT(fallback, arrival), out, "ARRIVAL values; verdict on the message read"},
    {"fallback_last_refusal", u8, SEAT(fallback, last_refusal), out, "ARRIVAL values"},
    {"fallback_freshness", u8, SEAT(fallback, freshness), out, "FRESHNESS values"},
    {"command_policy", u64, HEADER(command_policy), out, "hash of the policy whose command is in use"},
    {"candidate_command_sequence_seen", u64, SEAT(candidate, command_sequence_seen), in,
     "of the message read from the policy that is not in charge; 0 none"},
    {"candidate_policy_hash", u64, CANDIDATE(policy_hash), in,
     "of the candidate's mailbox, whoever is in charge; 0: none yet"},
    {"candidate_asked_policy", u64, CANDIDATE(asked_policy), in, "of a swap: the policy that was named"},
    {"candidate_age", i64, SEAT(candidate, age), out, "ns, of the command of the policy that is not in charge"},
    {"candidate_command_sequence", u64, SEAT(candidate, command_sequence), out, "in use, and not played; 0 none"},
    {"candidate_observation_answered", u64, SEAT(candidate, observation_answered), out, ""},
    {"candidate_beyond_range", u64, CANDIDATE(beyond_range), out, "bit per joint: its target is out of range"},
    {"candidate_beyond_limits", u64, CANDIDATE(beyond_limits), out,
     "bit per joint: its path would touch a limit of velocity or acceleration"},
    {"candidate_distance", f32, CANDIDATE(distance), out,
     "rad, of a slide at its motor, of its targets from those in use, of the farthest joint"},
    {"candidate_mailbox", u8, SEAT(candidate, mailbox), in, "ARRIVAL values; accepted: a message was read"},
    {"candidate_session", u8, SEAT(candidate, session), in, "changes when another mailbox is read"},
    {"candidate_arrival", u8, SEAT(candidate, arrival), out, "ARRIVAL values; verdict on the message read"},
    {"candidate_last_refusal", u8, SEAT(candidate, last_refusal), out, "ARRIVAL values"},
    {"candidate_freshness", u8, SEAT(candidate, freshness), out, "FRESHNESS values"},
    {"policy_change", u8, CANDIDATE(change), out, "what became of a change of policy", kPolicyChanges},
    {"candidate_in_charge", u8, CANDIDATE(in_charge), out,
     "1: after this tick the candidate's mailbox is the policy's, and the other way round"},
    {"candidate_on_probation", u8, CANDIDATE(on_probation), out, "1: after this tick"},
    {"candidate_is_asked", u8, CANDIDATE(is_asked), out, "1: a change is asked for and has not come yet"},
};
#undef SEAT
#undef CANDIDATE
#undef IMU
#undef HEADER

#define BUS(member) offsetof(BusHealth, member)
constexpr TickField kBusFields[] = {
    {"bus_tx_dropped", u32, BUS(tx_dropped), in, "frames, since start"},
    {"bus_rx_dropped", u32, BUS(rx_dropped), in, "frames, since start"},
    {"bus_foreign_frames", u32, BUS(foreign_frames), in, "frames, since start"},
    {"bus_state", u8, BUS(state), in, "", kBusStateNames},
    {"bus_flooded", u8, BUS(flooded), in, "1: more frames arrived for this tick than our drives can say"},
    {"bus_left_at", i64, BUS(left_at), in, "ns, when our newest frame was on the wire; 0: the bus does not say"},
    {"bus_waiting_since", i64, BUS(waiting_since), in,
     "ns, our oldest frame that has not left was handed over; 0: none"},
};
#undef BUS

#define FEEDBACK(member) offsetof(JointRecord, feedback) + offsetof(JointFeedback, member)
#define JOINT(member) offsetof(JointRecord, member)
constexpr TickField kJointFields[] = {
    {"feedback_received_at", i64, FEEDBACK(received_at), in, "ns, CLOCK_MONOTONIC"},
    {"feedback_q", f32, FEEDBACK(q), in, "rad, of a slide m"},
    {"feedback_dq", f32, FEEDBACK(dq), in, "rad/s, of a slide m/s"},
    {"feedback_tau", f32, FEEDBACK(tau), in, "Nm, of a slide N"},
    {"feedback_temperature", f32, FEEDBACK(temperature_C), in, "degrees Celsius"},
    {"feedback_casing", u8, FEEDBACK(casing_C), in,
     "whole degrees Celsius of the casing or output stage; 0: the drive does not tell it apart"},
    {"feedback_error_code", u32, FEEDBACK(error_code), in, "the drive protocol's own code"},
    {"feedback_drive_state", u8, FEEDBACK(drive_state), in, "", kDriveStateNames},
    {"feedback_replies", u8, FEEDBACK(replies), in, "position reports since start, modulo 256"},
    {"refused", u8, FEEDBACK(refused), in, "what the last guard refused of the previous tick's frames",
     kWireVerdictNames},
    {"q_estimate", f32, JOINT(q_estimate), out, "rad, of a slide m"},
    {"dq_estimate", f32, JOINT(dq_estimate), out, "rad/s, of a slide m/s"},
    {"q_reference", f32, JOINT(q_reference), out, "rad, of a slide m"},
    {"dq_reference", f32, JOINT(dq_reference), out, "rad/s, of a slide m/s"},
    {"tau_gravity", f32, JOINT(tau_gravity), out, "Nm, of a slide N"},
    {"tau_total", f32, JOINT(tau_total), out, "Nm, of a slide N"},
    {"q_command", f32, JOINT(q_command), out, "rad, of a slide m"},
    {"dq_command", f32, JOINT(dq_command), out, "rad/s, of a slide m/s"},
    {"kp_command", f32, JOINT(kp_command), out, "Nm/rad, of a slide N/m"},
    {"kd_command", f32, JOINT(kd_command), out, "Nm s/rad, of a slide N s/m"},
    {"tau_command", f32, JOINT(tau_command), out, "Nm, of a slide N"},
    {"interventions", u16, JOINT(interventions), out, "bit mask, see INTERVENTION constants"},
    {"reply_faults", u16, JOINT(reply_faults), out,
     "bit mask: 1 lost, 2 repeated, 4 delayed, 8 outlier, 16 jumped, 32 contradicts, 64 frozen, 128 from the future, "
     "256 moved unheard"},
    {"drive_enabled", u8, JOINT(drive_enabled), out, "1: this drive is told to be enabled; 0: to de-energise"},
    {"behind", u8, JOINT(behind), out, "1: too far from its reference for feedback.following_timeout"},
};
#undef FEEDBACK
#undef JOINT

}  // namespace

std::span<const TickField> header_fields() {
  return kHeaderFields;
}
std::span<const TickField> bus_fields() {
  return kBusFields;
}
std::span<const TickField> joint_fields() {
  return kJointFields;
}

}  // namespace takt::monitor
