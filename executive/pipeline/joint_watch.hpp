// SPDX-License-Identifier: Apache-2.0
// Which replies of a joint's drive the tick believes, and when what they tell cannot be true. Pure.
//
// outlier      its position is further from the one before than the joint can get there: velocity_hard for the time
//              between (behind a gap also for the gap, in which the reply before may have waited), and
//              FeedbackLimits::jump. It does not reach the estimate, and is counted; until a believed
//              reply follows, the joint is in doubt: it only damps
// jumped       outliers one after the other (kLasting), or again and again: the position is another one now
// contradicts  over about kFeedbackMemory_s the positions moved otherwise than the drive's own velocities say:
//              wrong scale or sign, or one of the two stands still. By how far they went; and, of a joint that goes to
//              and fro, by the slope of the one over the other, stretch by stretch (kStretch_s). Steps into a gap of
//              more than three replies, and out of it, say nothing
// frozen       one position from reply to reply (bit by bit),
//              - while the drive's own velocities add up to a motion;
//              - or velocity and torque stand still with it, while the torque that we ask for changed;
//              - or, where the loop is closed here or the drive tells no velocity of its own: with what velocity it
//                tells, while the torque that we ask for changed by more than friction holds, for long enough to move
//                the joint, or a velocity drive's path moved on. Near the joint's limits, where it may rest on a stop,
//                this says nothing
// moved_unheard  after a silence of kLongSilence_ticks and of the feedback timeout, or after a suspend, it reads
//              elsewhere than before by more than kMovedUnheard: it was moved, or its drive lost its zero with its
//              supply. It stays until a person resets in standby, and blocks arming
// from_future  stamped more than a control period ahead of the tick: as if it had not come
//
// What was found holds for kSuspectFor after the newest reply that showed it. A joint at rest, pressed against its stop
// or held by something that yields as much as its encoder resolves shows none of it. After a silence beyond the
// feedback timeout, and after a suspend, the next reply begins anew.
#pragma once

#include <cstdint>
#include <type_traits>

#include "executive/contract/feedback.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

inline constexpr Duration kSuspectFor = milliseconds(500);
inline constexpr float kFeedbackMemory_s = 0.5F;
inline constexpr float kStretch_s = 0.016F;  // long enough that a coarse encoder's steps tell a motion
inline constexpr std::int64_t kLongSilence_ticks = 50;
inline constexpr float kMovedUnheard = 0.05F;  // rad, times JointLimits::per_rad
inline constexpr int kLasting = 3;             // outliers one after the other

struct JointWatch {
  MonoTime judged_at;      // stamp of the newest reply that was looked at; unset: none yet
  MonoTime believed_at;    // of the newest believed one
  MonoTime still_since;    // of the first believed one in a row that tells the position of the newest
  MonoTime same_since;     // likewise: position, velocity and torque
  MonoTime swung_at;       // of the reply since which our torque has swung while nothing changed; unset: it has not
  MonoTime suspect_until;  // `found` holds until then
  float q = 0;             // rad, of the newest believed reply, as are the next two
  float dq = 0;            // rad/s
  float tau = 0;           // Nm
  float ahead = 0;         // rad: how much further the positions moved than the velocities say, leaky
  float travel = 0;        // rad: how far it went by the larger of the two, leaky
  float slid = 0;          // rad: what the velocities add up to since still_since, leaky
  float stretch = 0;       // s, of the present stretch
  float stretch_moved = 0, stretch_told = 0;  // rad, by positions and by velocities, in it
  // rad^2, leaky sums over stretches: moved times told, told times told. Their quotient is the slope.
  float moved_told = 0, told_told = 0;
  float went = 0;                     // rad, leaky: what both agree on of each stretch, whichever way
  float told = 0;                     // Nm, that the newest setpoint makes at what the drive tells
  float beyond = 0;                   // Nm, of it beyond what gravity takes
  float path = 0;                     // rad, the newest tick's reference
  float told_low = 0, told_high = 0;  // Nm, since same_since
  float beyond_from = 0;              // Nm, when position and velocity (where it is told) began to stay
  float path_from = 0;                // rad, likewise
  float expected_dq = 0;              // rad/s: what the torque since then would have made of the joint
  float expected_q = 0;               // rad
  std::uint32_t outliers = 0;         // since start, modulo 2^32
  ReplyFaultMask found = 0;           // jumped, contradicts, frozen
  std::uint8_t score = 0;             // outliers of late: two for each, less one for each believed reply
  std::uint8_t in_doubt = 0;          // 1: the newest reply is an outlier
  std::uint8_t torque_lives = 0;      // 1: the torque that it tells has changed
  std::uint8_t moved_unheard = 0;     // 1: as ReplyFault says
  std::uint16_t waited_ms = 0;        // the newest believed reply ended a gap of so long, and may have waited as long
};

enum class Belief : std::uint8_t {
  none,     // nothing new, or nothing that is believed
  follows,  // the newest reply goes on from the ones before
  begins    // it begins anew: what was estimated from the ones before is void
};

// Judges what was received by `now`. Only what it believes may reach the estimate.
Belief take_feedback(JointWatch& watch, const JointFeedback& feedback, MonoTime now, const JointConfig& joint,
                     const TickConfig& config);

// After a suspend: the next reply begins anew, and is compared with where the joint was.
void forget_replies(JointWatch& watch);
// A person in standby has been told that the joint reads elsewhere, and lets it stand.
void accept_place(JointWatch& watch);

// What the tick asks of a joint whose drive makes torque: by the drive's own word on its state, for our estimate
// follows each step of a coarse encoder. `gravity`: Nm, what the model says it takes; `path`: rad, the reference.
void note_told(JointWatch& watch, const JointSetpoint& setpoint, float gravity, float path, const JointConfig& joint);
// Nothing that makes torque reached the drive.
void note_untold(JointWatch& watch);

// Bits of JointRecord::reply_faults, of this tick.
ReplyFaultMask feedback_faults(const JointWatch& watch, const JointFeedback& feedback, MonoTime now,
                               const TickConfig& config);

// Those that make feedback_implausible.
inline constexpr ReplyFaultMask kImplausible =
    static_cast<ReplyFaultMask>(bit(ReplyFault::jumped) | bit(ReplyFault::contradicts) | bit(ReplyFault::frozen));

// The largest share of each limit that was reached, 1: at the limit. For the margin of a robot at work.
struct FeedbackMargin {
  float contradiction = 0, frozen = 0;
};
FeedbackMargin margin_of(const JointWatch& watch, const JointConfig& joint, const TickConfig& config);

static_assert(std::is_trivially_copyable_v<JointWatch> && sizeof(JointWatch) == 6 * 8 + 21 * 4 + 12);

}  // namespace takt::pipeline
