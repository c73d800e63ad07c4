// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/bus_watch.hpp"

#include <algorithm>

namespace takt::pipeline {
namespace {

constexpr std::uint32_t kOneEvent = 1U << 16U;
static_assert(kWholeShare == kOneEvent);
static_assert(std::uint64_t{kMaxBusFaultTicks} * kOneEvent + 255ULL * kOneEvent < (1ULL << 32U));

constexpr std::uint32_t one_if(bool holds) {
  return holds ? 1U : 0U;
}

// Not judged: silent for too long, or just back.
bool is_judged(ReplyWatch& watch, bool new_reply, std::uint32_t silence) {
  watch.silent = new_reply ? std::uint16_t{0} : static_cast<std::uint16_t>(std::min(watch.silent + 1, 0xFFFF));
  if (watch.heard != 0 && watch.silent >= silence) watch.heard = 0;
  if (watch.heard == 0 && new_reply) {
    watch.heard = 1;
    watch.settling = kPatience;
  }
  if (watch.heard != 0 && watch.settling == 0) return true;
  if (watch.settling != 0) --watch.settling;
  watch.owed = 0;
  watch.behind = 0;
  return false;
}

// A window is as long as any other's, of as many turns as fit.
BusFaultLimits limits_of(const Turns& turns, BusFaultLimits limits) {
  const std::uint32_t every = std::max<std::uint32_t>(turns.every, 1);
  limits.window_ticks = std::max(limits.window_ticks / every, 1U);
  return limits;
}

// Turns without a reply that end the watch.
std::uint32_t silence_of(const Turns& turns, const TickConfig& config) {
  const std::int64_t turn = std::max<std::int64_t>(config.period.ns, 1) * std::max<std::int64_t>(turns.every, 1);
  return static_cast<std::uint32_t>(std::min<std::int64_t>(config.feedback_timeout.ns / turn, 0xFFFF));
}

}  // namespace

void LeakyCount::tick(std::uint32_t events, std::uint32_t window_ticks) {
  if (level_ == 0 && events == 0) return;
  const std::uint32_t leak = (level_ + window_ticks - 1) / window_ticks;
  level_ = std::min(level_ - leak + events * kOneEvent, window_ticks * kOneEvent);
}

ReplyEvents take_replies(ReplyWatch& watch, std::uint8_t replies, std::uint32_t excused, std::uint32_t silence) {
  const int arrived = static_cast<std::uint8_t>(replies - watch.replies);
  watch.replies = replies;
  ReplyEvents events;
  if (!is_judged(watch, arrived != 0, silence)) return events;
  const int owed_before = watch.owed;
  int owed = std::min(owed_before + 1, 0xFF) - arrived;
  if (owed < -kSpread) {
    const auto early = static_cast<std::uint32_t>(-kSpread - owed);
    events.repeated = early - std::min(early, excused);
    owed = -kSpread;
  }
  events.delayed = static_cast<std::uint32_t>(std::max(owed_before - std::max(owed, kSpread), 0));
  watch.behind = owed > kSpread ? static_cast<std::uint16_t>(watch.behind + 1) : std::uint16_t{0};
  if (watch.behind >= kPatience) {
    events.lost = static_cast<std::uint32_t>(owed);
    owed = 0;
    watch.behind = 0;
  }
  watch.owed = static_cast<std::int16_t>(owed);
  return events;
}

void note_replies(ReplyWatch& watch, const ReplyEvents& events, std::uint32_t window_ticks) {
  watch.lost.tick(events.lost, window_ticks);
  watch.repeated.tick(events.repeated, window_ticks);
  watch.delayed.tick(events.delayed, window_ticks);
}

void note_health(BusWatch& watch, const BusHealth& health, std::uint32_t window_ticks) {
  watch.error_passive.tick(one_if(health.state == BusState::error_passive), window_ticks);
  watch.transmit_drops.tick(one_if(health.tx_dropped != watch.tx_dropped), window_ticks);
  watch.receive_drops.tick(one_if(health.rx_dropped != watch.rx_dropped), window_ticks);
  watch.foreign.tick(one_if(health.foreign_frames != watch.foreign_frames), window_ticks);
  watch.babble.tick(one_if(health.flooded != 0), window_ticks);
  watch.tx_dropped = health.tx_dropped;
  watch.rx_dropped = health.rx_dropped;
  watch.foreign_frames = health.foreign_frames;
}

ReplyFaultMask reply_faults(const ReplyWatch& watch, const BusFaultLimits& limits) {
  const auto when = [&limits](const LeakyCount& count, std::uint32_t share, ReplyFault fault) {
    return count.exceeds(share, limits.window_ticks) ? bit(fault) : ReplyFaultMask{0};
  };
  return static_cast<ReplyFaultMask>(when(watch.lost, limits.replies_lost, ReplyFault::lost) |
                                     when(watch.repeated, limits.replies_repeated, ReplyFault::repeated) |
                                     when(watch.delayed, limits.replies_delayed, ReplyFault::delayed));
}

CauseMask bus_faults(const BusWatch& watch, const BusFaultLimits& limits) {
  const auto when = [&limits](const LeakyCount& count, std::uint32_t share, Cause cause) {
    return count.exceeds(share, limits.window_ticks) ? bit(cause) : CauseMask{0};
  };
  return when(watch.error_passive, limits.error_passive, Cause::bus_error_passive) |
         when(watch.transmit_drops, limits.transmit_drops, Cause::transmit_queue_full) |
         when(watch.receive_drops, limits.receive_drops, Cause::receive_overflow) |
         when(watch.foreign, limits.foreign_frames, Cause::foreign_node) |
         when(watch.babble, limits.babble, Cause::bus_babble);
}

void watch_links(LinkWatch& watch, const TickConfig& config, TickRecord& record) {
  const std::uint32_t window = config.bus_faults.window_ticks;
  const auto excused =
      static_cast<std::uint32_t>(std::min<std::uint64_t>(record.header.skipped_periods - watch.skipped_periods, 0xFF));
  watch.skipped_periods = record.header.skipped_periods;
  for (std::size_t b = 0; b < config.bus_count; ++b) note_health(watch.buses[b], record.header.buses[b], window);
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    ReplyWatch& joint = watch.joints[j];
    const Turns& turns = config.joints[j].turns;
    const std::uint32_t spared = std::min(joint.excused + excused, 0xFFU);
    joint.excused = static_cast<std::uint8_t>(spared);
    const BusFaultLimits limits = limits_of(turns, config.bus_faults);
    if (turns.has(record.header.tick)) {
      joint.excused = 0;
      note_replies(joint, take_replies(joint, record.joints[j].feedback.replies, spared, silence_of(turns, config)),
                   limits.window_ticks);
    }
    record.joints[j].reply_faults = reply_faults(joint, limits);
  }
}

CauseMask link_faults(const LinkWatch& watch, const TickRecord& record, const TickConfig& config) {
  CauseMask active = 0;
  for (std::size_t b = 0; b < config.bus_count; ++b) active |= bus_faults(watch.buses[b], config.bus_faults);
  ReplyFaultMask replies = 0;
  for (std::size_t j = 0; j < config.joint_count; ++j) replies |= record.joints[j].reply_faults;
  if ((replies & bit(ReplyFault::lost)) != 0) active |= bit(Cause::replies_lost);
  if ((replies & bit(ReplyFault::repeated)) != 0) active |= bit(Cause::replies_repeated);
  if ((replies & bit(ReplyFault::delayed)) != 0) active |= bit(Cause::replies_delayed);
  return active;
}

}  // namespace takt::pipeline
