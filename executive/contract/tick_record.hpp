// SPDX-License-Identifier: Apache-2.0
// One tick, whole: every input the decision read and every output it produced, so that replay can recompute it.
//
// A record is a TickRecordHeader followed by joint_count JointRecords. The new command, when one arrived, and the
// periodic TickState keyframe travel in rings of their own, tied to the tick number.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <type_traits>

#include "executive/contract/feedback.hpp"
#include "executive/contract/imu.hpp"
#include "executive/contract/intervention.hpp"
#include "executive/contract/joints.hpp"
#include "executive/contract/layout.hpp"
#include "executive/contract/mode.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/overrun.hpp"
#include "executive/contract/seat.hpp"
#include "executive/contract/torque_output.hpp"
#include "executive/contract/verdict.hpp"

namespace takt {

// `stop` may be repeated without end: a damped stop, however often it is asked. `press_stop` is a person's hand on the
// stop: the first is a stop, one that comes while it is in force de-energises. `deenergise` does so at once. `mark`
// decides nothing: a person says "look here", and the tick that read it says so in the record. `swap`: the candidate
// is to play (pipeline/candidate.hpp); `back`: the robot's own policy again.
enum class OperatorRequest : std::uint8_t {
  none,
  arm,
  stop,
  reset,
  shutdown,
  mark,
  press_stop,
  deenergise,
  swap,
  back
};
inline constexpr std::size_t kOperatorRequestCount = 10;

// Age of the command in use, in parts that add up exactly: total = sense + queue + infer + publish + hold.
struct AgeParts {
  Duration sense;    // oldest sample -> observation published
  Duration queue;    // observation published -> inference started
  Duration infer;    // inference started -> ended
  Duration publish;  // inference ended -> first tick that used the command
  Duration hold;     // first use -> now
  [[nodiscard]] constexpr Duration total() const { return sense + queue + infer + publish + hold; }
};
template <std::same_as<AgeParts> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(sense), TAKT_FIELD(queue), TAKT_FIELD(infer), TAKT_FIELD(publish), TAKT_FIELD(hold),
  };
}

// The policy of one seat, judged in every tick. All zero where the robot has none there.
struct SeatRecord {
  std::uint64_t command_sequence_seen = 0;  // input: of the message read this tick; 0 none
  Duration age;                             // of its command in use; zero while freshness is missing
  std::uint64_t command_sequence = 0;       // in use; 0 none
  std::uint64_t observation_answered = 0;
  Arrival mailbox = Arrival::none;  // input: none, contended, corrupt; accepted means: a message was read
  std::uint8_t session = 0;         // input: differs from the previous tick's when another mailbox is read now
  Arrival arrival = Arrival::none;
  Arrival last_refusal = Arrival::none;  // of the newest message; none: it was accepted, or there was none
  Freshness freshness = Freshness::missing;
  std::uint8_t reserved[3] = {};
};
template <std::same_as<SeatRecord> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(command_sequence_seen),
      TAKT_FIELD(age),
      TAKT_FIELD(command_sequence),
      TAKT_FIELD(observation_answered),
      TAKT_FIELD(mailbox),
      TAKT_FIELD(session),
      TAKT_FIELD(arrival),
      TAKT_FIELD(last_refusal),
      TAKT_FIELD(freshness),
      TAKT_FIELD(reserved),
  };
}

// What became of a change of policy in a tick.
enum class PolicyChange : std::uint8_t {
  none,
  asked,              // by a person: the next answer of the other policy takes over
  refused,            // no policy to change to: not the policy that was named, or none of its commands is fresh
  expired,            // no answer of the other policy came in time: nothing changed
  swapped,            // the candidate plays, on probation
  back,               // the robot's own policy plays again, as a person asked
  confirmed,          // probation is over
  back_for_age,       // on probation: too many ticks without a fresh command
  back_for_refusals,  // on probation: too many messages refused for what they say
  back_for_range,     // on probation: too many ticks with a target out of range
  back_for_stop       // on probation: the robot stopped, or was degraded
};
inline constexpr std::size_t kPolicyChangeCount = 11;

constexpr std::string_view name(PolicyChange change) {
  constexpr std::array<std::string_view, kPolicyChangeCount> names{
      "none",      "asked",        "refused",           "expired",        "swapped",      "back",
      "confirmed", "back_for_age", "back_for_refusals", "back_for_range", "back_for_stop"};
  const auto index = static_cast<std::size_t>(change);
  return index < names.size() ? names[index] : "invalid";
}
// The robot is another policy's from this tick on.
constexpr bool is_handover(PolicyChange change) {
  return change >= PolicyChange::swapped && change != PolicyChange::confirmed;
}

// What is told of the candidate's seat alone. All zero where there is no candidate.
struct CandidateRecord {
  std::uint64_t policy_hash = 0;   // input: of the candidate's mailbox, whichever policy is in charge; 0: none yet
  std::uint64_t asked_policy = 0;  // input: of a swap, the policy that was named
  JointMask beyond_range = 0;      // joints whose target would be brought into its range
  JointMask beyond_limits = 0;     // joints whose path would touch a limit of velocity or acceleration
  float distance = 0;              // rad: of its targets from those in use, of the joint that is farthest
  PolicyChange change = PolicyChange::none;
  std::uint8_t in_charge = 0;     // 1: after this tick the candidate's mailbox is the policy's, and the other way round
  std::uint8_t on_probation = 0;  // 1: after this tick
  std::uint8_t is_asked = 0;      // 1: after this tick a change is asked for and has not come yet
};
template <std::same_as<CandidateRecord> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(policy_hash),   TAKT_FIELD(asked_policy), TAKT_FIELD(beyond_range),
      TAKT_FIELD(beyond_limits), TAKT_FIELD(distance),     TAKT_FIELD(change),
      TAKT_FIELD(in_charge),     TAKT_FIELD(on_probation), TAKT_FIELD(is_asked),
  };
}

struct TickRecordHeader {
  // inputs
  std::uint64_t tick = 0;
  MonoTime now;                       // scheduled-and-woken instant of this tick
  Duration lateness;                  // now - scheduled wake-up
  Duration last_duration;             // how long the previous tick worked
  std::uint64_t skipped_periods = 0;  // since start
  MonoTime last_sent_at;              // just before the previous tick's first frame; unset: it sent nothing
  JointMask last_damped = 0;          // joints to which the previous tick sent its damping instead: it was too late
  MonoTime asked_at;                  // when the executive heard the stop or shutdown of operator_request; else unset
  BusHealth buses[kMaxBuses];
  ImuSample imu;                       // as it was read, newest; sequence 0: none yet
  std::uint64_t recorded_through = 0;  // newest tick the recorder has on its medium; 0: nothing records
  std::uint32_t slept_ms = 0;          // the computer was suspended this long since the tick before; 0: it was not
  std::uint32_t joint_count = 0;
  std::uint8_t bus_count = 0;
  OperatorRequest operator_request = OperatorRequest::none;
  OverrunCause overrun_cause = OverrunCause::none;  // of the previous period
  TorqueOutputState torque_output = TorqueOutputState::none;
  // outputs, but for what SeatRecord and CandidateRecord call inputs
  Mode mode = Mode::standby;  // after this tick
  Mode previous_mode = Mode::standby;
  Cause cause = Cause::none;  // of the transition, if one happened this tick
  ImuVerdict imu_verdict = ImuVerdict::absent;
  std::uint64_t causes_active = 0;          // bit per Cause that holds this tick
  std::uint64_t observation_published = 0;  // id published this tick; 0 none
  std::uint64_t command_policy = 0;         // hash of the policy whose command is in use
  AgeParts age;                             // of the policy's command in use; all zero while its freshness is missing
  std::uint32_t window_misses = 0;          // exact count over the sliding window
  std::uint32_t window_ticks = 0;
  std::uint32_t integration_errors = 0;  // stamps that ran backwards, since start
  std::uint32_t refused_commands = 0;    // since start
  Player player = Player::none;          // whose chunk the robot follows
  std::uint8_t chunk_step = 0;           // step being played, of `player`
  std::uint8_t drives_enabled = 0;       // 1 when drives are told to be enabled; which: JointRecord::drive_enabled
  std::uint8_t torque_permitted = 0;     // 1 when torque_output is told to permit torque
  std::uint8_t reserved[4] = {};
  PerSeat<SeatRecord> seats;
  CandidateRecord candidate;
};
template <std::same_as<TickRecordHeader> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(tick),
      TAKT_FIELD(now),
      TAKT_FIELD(lateness),
      TAKT_FIELD(last_duration),
      TAKT_FIELD(skipped_periods),
      TAKT_FIELD(last_sent_at),
      TAKT_FIELD(last_damped),
      TAKT_FIELD(asked_at),
      TAKT_FIELD(buses),
      TAKT_FIELD(imu),
      TAKT_FIELD(recorded_through),
      TAKT_FIELD(slept_ms),
      TAKT_FIELD(joint_count),
      TAKT_FIELD(bus_count),
      TAKT_FIELD(operator_request),
      TAKT_FIELD(overrun_cause),
      TAKT_FIELD(torque_output),
      TAKT_FIELD(mode),
      TAKT_FIELD(previous_mode),
      TAKT_FIELD(cause),
      TAKT_FIELD(imu_verdict),
      TAKT_FIELD_OF(Cause, causes_active),
      TAKT_FIELD(observation_published),
      TAKT_FIELD(command_policy),
      TAKT_FIELD(age),
      TAKT_FIELD(window_misses),
      TAKT_FIELD(window_ticks),
      TAKT_FIELD(integration_errors),
      TAKT_FIELD(refused_commands),
      TAKT_FIELD(player),
      TAKT_FIELD(chunk_step),
      TAKT_FIELD(drives_enabled),
      TAKT_FIELD(torque_permitted),
      TAKT_FIELD(reserved),
      TAKT_FIELD(seats),
      TAKT_FIELD(candidate),
  };
}

struct JointRecord {
  JointFeedback feedback;     // input
  float q_estimate = 0.0F;    // rad
  float dq_estimate = 0.0F;   // rad/s
  float q_reference = 0.0F;   // rad, constrained reference
  float dq_reference = 0.0F;  // rad/s
  float tau_gravity = 0.0F;   // Nm, model
  float tau_total = 0.0F;     // Nm, torque the drive will produce at this feedback
  float q_command = 0.0F;     // to the drive, joint side: rad
  float dq_command = 0.0F;    // rad/s
  float kp_command = 0.0F;    // Nm/rad
  float kd_command = 0.0F;    // Nm s/rad
  float tau_command = 0.0F;   // Nm, feed-forward
  InterventionMask interventions = 0;
  ReplyFaultMask reply_faults = 0;
  std::uint8_t drive_enabled = 0;  // 1 when this drive is told to be enabled; 0: to de-energise
  std::uint8_t behind = 0;         // 1: too far from its reference for feedback.following_timeout
  std::uint8_t reserved[6] = {};
};
template <std::same_as<JointRecord> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(feedback),
      TAKT_FIELD(q_estimate),
      TAKT_FIELD(dq_estimate),
      TAKT_FIELD(q_reference),
      TAKT_FIELD(dq_reference),
      TAKT_FIELD(tau_gravity),
      TAKT_FIELD(tau_total),
      TAKT_FIELD(q_command),
      TAKT_FIELD(dq_command),
      TAKT_FIELD(kp_command),
      TAKT_FIELD(kd_command),
      TAKT_FIELD(tau_command),
      TAKT_FIELD_OF(Intervention, interventions),
      TAKT_FIELD_OF(ReplyFault, reply_faults),
      TAKT_FIELD(drive_enabled),
      TAKT_FIELD(behind),
      TAKT_FIELD(reserved),
  };
}

// Whether the joint's drive is written to in this tick: in its turns, and in every change of mode, for a stop waits for
// no turn.
constexpr bool is_written(const Turns& turns, const TickRecordHeader& header) {
  return turns.has(header.tick) || header.mode != header.previous_mode;
}

// The tick in which its command was first played.
constexpr bool is_first_use(const TickRecordHeader& header) {
  return header.seats[Seat::policy].freshness != Freshness::missing && header.age.hold == Duration{};
}

static_assert(std::is_standard_layout_v<AgeParts> && sizeof(AgeParts) == 40);
static_assert(std::is_standard_layout_v<TickRecordHeader> && std::is_trivially_copyable_v<TickRecordHeader>);
static_assert(sizeof(SeatRecord) == 40 && sizeof(CandidateRecord) == 40);
static_assert(std::is_standard_layout_v<JointRecord> && sizeof(JointRecord) == 88);

// Room for the largest record; only used_bytes() of it travel.
struct TickRecord {
  TickRecordHeader header;
  JointRecord joints[kMaxJoints];
  [[nodiscard]] constexpr std::size_t used_bytes() const { return used_bytes(header.joint_count); }
  static constexpr std::size_t used_bytes(std::size_t joint_count) {
    return sizeof(TickRecordHeader) + joint_count * sizeof(JointRecord);
  }
};
template <std::same_as<TickRecord> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(header),
      TAKT_FIELD(joints),
  };
}

// One CAN frame as it crossed the edge, for the run's candump log. Mirrors struct canfd_frame's content.
// `refused`: the last guard kept it from the bus; what left instead follows it.
enum class FrameDirection : std::uint8_t { received, sent, refused };
struct FrameRecord {
  MonoTime stamp;  // receive: kernel stamp; send: just before the write
  std::uint64_t tick = 0;
  std::uint32_t can_id = 0;  // with CAN_EFF_FLAG / CAN_RTR_FLAG / CAN_ERR_FLAG
  std::uint8_t bus = 0;      // index into the configuration's buses
  FrameDirection direction = FrameDirection::received;
  std::uint8_t length = 0;    // 0..64
  std::uint8_t fd_flags = 0;  // CANFD_* flags; 0x80 marks an FD frame
  std::uint8_t data[64] = {};
};
template <std::same_as<FrameRecord> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(stamp),     TAKT_FIELD(tick),   TAKT_FIELD(can_id),   TAKT_FIELD(bus),
      TAKT_FIELD(direction), TAKT_FIELD(length), TAKT_FIELD(fd_flags), TAKT_FIELD(data),
  };
}
static_assert(std::is_standard_layout_v<FrameRecord> && sizeof(FrameRecord) == 88);

// Prefix of the keyframe ring's payloads; the state's used bytes follow.
struct TickTag {
  std::uint64_t tick = 0;
};
template <std::same_as<TickTag> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(tick),
  };
}
static_assert(sizeof(TickTag) == 8);

// Prefix of the command ring's payloads. The message follows: whole, or, of a refused one, only its header.
struct CommandTag {
  std::uint64_t tick = 0;   // that read it
  std::uint32_t bytes = 0;  // of the message, whatever follows of it
  std::uint32_t crc = 0;    // CRC-32C of the message where only its header follows; 0: too long to have been read
  Player sender = Player::policy;  // whose mailbox it was read from
  std::uint8_t reserved[7] = {};
};
template <std::same_as<CommandTag> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(tick), TAKT_FIELD(bytes), TAKT_FIELD(crc), TAKT_FIELD(sender), TAKT_FIELD(reserved),
  };
}
static_assert(sizeof(CommandTag) == 24);

}  // namespace takt
