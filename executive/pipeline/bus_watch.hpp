// SPDX-License-Identifier: Apache-2.0
// Watches what buses and drives say, tick by tick, for faults that no single tick can show: replies that are lost,
// repeated or delayed, frames dropped on either side, strangers, babble, a controller that stays error-passive.
//
// Each kind feeds a leaky counter: an event adds one, and every tick a `window_ticks`-th of what is in it leaks out, so
// that it follows the share of ticks with an event over about the last window. A fault holds while its share is over
// its limit (tick_config.hpp); the leak is the hysteresis. A share of 1 is never exceeded: that fault is switched off.
//
// Replies: every tick owes one, once the joint has spoken. Up to kSpread replies early or late is jitter. Beyond that,
//   late and then there      delayed
//   owed for kPatience ticks lost
//   earlier than owed        repeated
// Periods that the executive skipped excuse as many early replies: some drives report by themselves. A joint silent
// for feedback_timeout is feedback_lost's concern: it is looked at again kPatience ticks after it speaks again, so that
// the backlog of a stalled bus is no fault of its own.
// A joint whose drive is written to every n-th tick owes a reply per turn: it is looked at in its turns, and a tick
// above is a turn of it.
// Before the first reply, and before the first frame on a bus: no fault. Pure, bounded, integers only.
#pragma once

#include <cstdint>
#include <type_traits>

#include "executive/contract/feedback.hpp"
#include "executive/contract/joints.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

inline constexpr int kSpread = 2;     // replies early or late that are jitter: one tick either way, twice
inline constexpr int kPatience = 50;  // ticks that a reply may be owed

// Share of ticks with an event, leaky; 1/65536 events.
class LeakyCount {
 public:
  // events <= 255; 1 <= window_ticks <= kMaxBusFaultTicks, the same at every call.
  void tick(std::uint32_t events, std::uint32_t window_ticks);
  [[nodiscard]] bool exceeds(std::uint32_t share, std::uint32_t window_ticks) const {
    return level_ > share * window_ticks;
  }
  // 0..1, of the window's ticks.
  [[nodiscard]] double share(std::uint32_t window_ticks) const {
    return static_cast<double>(level_) / kWholeShare / window_ticks;
  }

 private:
  std::uint32_t level_ = 0;
};

// What became of one joint's replies in one tick: counts.
struct ReplyEvents {
  std::uint32_t lost = 0, repeated = 0, delayed = 0;
};

struct ReplyWatch {
  LeakyCount lost, repeated, delayed;
  std::int16_t owed = 0;      // replies expected and not there; negative: early ones
  std::uint16_t behind = 0;   // ticks in a row with more than kSpread owed
  std::uint16_t silent = 0;   // ticks in a row without a reply
  std::uint8_t replies = 0;   // JointFeedback::replies at the previous tick
  std::uint8_t heard = 0;     // 0: never, or silent for too long
  std::uint8_t settling = 0;  // ticks until it is judged
  std::uint8_t excused = 0;   // early replies that periods skipped since its last turn excuse
  std::uint8_t reserved[2] = {};
};

struct BusWatch {
  LeakyCount error_passive, transmit_drops, receive_drops, foreign, babble;
  std::uint32_t tx_dropped = 0, rx_dropped = 0, foreign_frames = 0;  // at the previous tick
};

struct LinkWatch {
  std::uint64_t skipped_periods = 0;  // at the previous tick
  BusWatch buses[kMaxBuses];
  ReplyWatch joints[kMaxJoints];
};

// One joint, one tick. `excused`: replies that may come on top; `silence`: ticks without a reply that end the watch.
ReplyEvents take_replies(ReplyWatch& watch, std::uint8_t replies, std::uint32_t excused, std::uint32_t silence);
void note_replies(ReplyWatch& watch, const ReplyEvents& events, std::uint32_t window_ticks);
// Counters are compared modulo 2^32.
void note_health(BusWatch& watch, const BusHealth& health, std::uint32_t window_ticks);

// Bits of JointRecord::reply_faults.
ReplyFaultMask reply_faults(const ReplyWatch& watch, const BusFaultLimits& limits);
CauseMask bus_faults(const BusWatch& watch, const BusFaultLimits& limits);

// This tick's inputs, as recorded, into the watch; fills in every joint's reply_faults.
void watch_links(LinkWatch& watch, const TickConfig& config, TickRecord& record);
// The causes that hold now. Reads the record's reply_faults.
CauseMask link_faults(const LinkWatch& watch, const TickRecord& record, const TickConfig& config);

static_assert(std::is_trivially_copyable_v<LinkWatch>);
static_assert(sizeof(LeakyCount) == 4 && sizeof(ReplyWatch) == 24 && sizeof(BusWatch) == 32);
static_assert(sizeof(LinkWatch) == 8 + kMaxBuses * sizeof(BusWatch) + kMaxJoints * sizeof(ReplyWatch));

}  // namespace takt::pipeline
