// SPDX-License-Identifier: Apache-2.0
#include "lab/trace/timeline.hpp"

#include <algorithm>
#include <ranges>

namespace takt::lab {

Answer& Timeline::answer_of(const TraceEvent& event) {
  std::vector<Answer>& same = answers[{event.observation_id, event.sequence}];
  const auto known = std::ranges::find(same, event.pid, &Answer::pid);
  if (known != same.end()) return *known;
  same.push_back({.pid = event.pid});
  return same.back();
}

void Timeline::end_span(std::vector<TracedSpan>& spans, const TraceEvent& event) {
  for (TracedSpan& span : spans | std::views::reverse) {
    if (span.pid != event.pid) continue;
    if (span.end_at.is_set()) break;
    span.end_at = event.at;
    return;
  }
  spans.push_back({.pid = event.pid, .begin_at = {}, .end_at = event.at});
}

void Timeline::end_tick(std::vector<TracedTick>& ticks, const TraceEvent& event) {
  if (ticks.empty() || ticks.back().tick != event.tick) ticks.push_back({.tick = event.tick});
  TracedTick& tick = ticks.back();
  tick.end_at = event.at;
  tick.age = event.age_total;
  tick.sequence = event.sequence;
  tick.mode = event.mode;
  tick.freshness = event.freshness;
}

void Timeline::add(const TraceEvent& event) {
  if (!first_at.is_set()) first_at = event.at;
  last_at = event.at;
  TracedProcess& process = processes[event.pid];
  switch (event.name) {
    case EventName::init:
      process = {event.process, event.config_hash, event.policy_hash, event.joints};
      return;
    case EventName::tick_begin:
      executives[event.pid].ticks.push_back(
          {.tick = event.tick, .now = event.stamp, .begin_at = event.at, .lateness = event.lateness});
      return;
    case EventName::command_consumed:
      executives[event.pid].consumptions.push_back(
          {event.tick, event.sequence, event.observation_id, event.at, event.arrival, event.age});
      return;
    case EventName::observation_published:
      executives[event.pid].publications[event.observation_id] = {event.sensed, event.published, event.at};
      return;
    case EventName::tick_end:
      return end_tick(executives[event.pid].ticks, event);
    case EventName::dequeue_begin:
      dequeues.push_back({.pid = event.pid, .begin_at = event.at});
      return;
    case EventName::dequeue_end:
      return end_span(dequeues, event);
    case EventName::infer_begin:
      answer_of(event).infer_begin_at = event.at;
      answer_of(event).inferred_from = event.stamp;
      return;
    case EventName::infer_end:
      answer_of(event).infer_end_at = event.at;
      answer_of(event).inferred_to = event.stamp;
      return;
    case EventName::publish_begin:
      answer_of(event).publish_begin_at = event.at;
      answer_of(event).outside_sensed_at = event.sensed;
      return;
    case EventName::publish_end:
      answer_of(event).publish_end_at = event.at;
      return;
    case EventName::drain_begin:
      drains.push_back({.pid = event.pid, .begin_at = event.at});
      return;
    case EventName::drain_end:
      return end_span(drains, event);
    case EventName::mode_changed:
      mode_changes.push_back({event.pid, event.tick, event.stamp, event.previous_mode, event.mode, event.cause});
      return;
  }
}

}  // namespace takt::lab
