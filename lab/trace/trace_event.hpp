// SPDX-License-Identifier: Apache-2.0
// One event of LTTng provider `takt`, as the review reads it: every field any of its events has, zero where an event
// lacks it. What the events mean is said in docs/tracing.md; kTraceEvents is the list of events and fields that the
// reader asks for and that a test compares with the provider.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "executive/contract/mono_time.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::lab {

enum class EventName : std::uint8_t {
  init,
  tick_begin,
  command_consumed,
  observation_published,
  tick_end,
  dequeue_begin,
  dequeue_end,
  infer_begin,
  infer_end,
  publish_begin,
  publish_end,
  drain_begin,
  drain_end,
  mode_changed,
};

struct TraceEvent {
  EventName name = EventName::init;
  MonoTime at;           // the tracer's own stamp
  std::int64_t pid = 0;  // as the process itself sees it
  std::uint64_t tick = 0;
  std::uint64_t observation_id = 0;
  std::uint64_t sequence = 0;
  MonoTime stamp;   // tick_begin, mode_changed: the tick's now; infer_begin, infer_end: what the command says
  MonoTime sensed;  // observation_published: of its oldest sample; publish_begin: of the oldest outside sensor
  MonoTime published;
  Duration lateness;
  AgeParts age;        // command_consumed
  Duration age_total;  // tick_end
  std::uint8_t previous_mode = 0, mode = 0, cause = 0, freshness = 0, arrival = 0;
  std::uint64_t config_hash = 0, policy_hash = 0;
  std::string process, joints;  // init
};

struct TraceEventShape {
  EventName event;
  std::string_view name;
  std::span<const std::string_view> fields;
};

// In the order of EventName.
std::span<const TraceEventShape> trace_events();

}  // namespace takt::lab
