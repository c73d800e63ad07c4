// SPDX-License-Identifier: Apache-2.0
#include "monitor/telemetry/command_traces.hpp"

#include <algorithm>

namespace takt::monitor {
namespace {

constexpr std::size_t kMostTicks = 16'384;  // frames run ahead of ticks by a ring's worth at most

CommandTrace refused(const TickRecordHeader& header) {
  return {.tick = header.tick,
          .sequence = header.seats[Seat::policy].command_sequence_seen,
          .policy_session = header.seats[Seat::policy].session,
          .mode = header.mode,
          .arrival = header.seats[Seat::policy].arrival,
          .sensed_at = header.now,
          .observed_at = header.now,
          .infer_began_at = header.now,
          .infer_ended_at = header.now,
          .consumed_at = header.now,
          .actuating_at = header.now,
          .actuated_at = header.now};
}

}  // namespace

void CommandTraces::frame(const FrameRecord& frame) {
  if (frame.direction != FrameDirection::sent) return;
  const auto [at, is_new] = sent_.try_emplace(frame.tick, Sent{frame.stamp, frame.stamp});
  at->second.last = std::max(at->second.last, frame.stamp);
  if (is_new && sent_.size() > kMostTicks) sent_.erase(sent_.begin());
}

void CommandTraces::tick(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  const auto found = sent_.find(header.tick);
  const Sent sent = found == sent_.end() ? Sent{header.now, header.now} : found->second;
  sent_.erase(sent_.begin(), sent_.upper_bound(header.tick));
  if (is_refusal(header.seats[Seat::policy].arrival)) return out_(refused(header));
  if (!is_first_use(header)) return;
  CommandTrace trace{.tick = header.tick,
                     .sequence = header.seats[Seat::policy].command_sequence,
                     .observation = header.seats[Seat::policy].observation_answered,
                     .policy_session = header.seats[Seat::policy].session,
                     .mode = header.mode,
                     .sensed_at = header.now - header.age.total()};
  trace.observed_at = trace.sensed_at + header.age.sense;
  trace.infer_began_at = trace.observed_at + header.age.queue;
  trace.infer_ended_at = trace.infer_began_at + header.age.infer;
  trace.consumed_at = trace.infer_ended_at + header.age.publish;
  trace.actuating_at = std::max(trace.consumed_at, sent.first);
  trace.actuated_at = std::max(trace.actuating_at, sent.last);
  out_(trace);
}

}  // namespace takt::monitor
