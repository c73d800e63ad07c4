// SPDX-License-Identifier: Apache-2.0
// What a trace tells, put in order: who took part, what each tick of an executive did, what each policy host answered.
// Fed event by event in order of time; a tick costs 80 bytes, so an hour at 1 kHz fits in memory. Pure.
//
// A trace may begin or end anywhere, and LTTng may have dropped events: whatever has no event stays unset.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "lab/trace/trace_event.hpp"

namespace takt::lab {

struct TracedProcess {
  std::string program{};  // "takt-executive", ...; empty: it never said
  std::uint64_t config_hash = 0, policy_hash = 0;
  std::string joints{};
};

struct TracedTick {
  std::uint64_t tick = 0;
  MonoTime now{};                 // the tick's own instant; unset: its begin is not in the trace
  MonoTime begin_at{}, end_at{};  // the tracer's stamps; unset: not in the trace
  Duration lateness{};
  Duration age{};                        // of the command in use
  std::uint64_t sequence = 0;            // of the command in use; 0 none
  std::uint8_t mode = 0, freshness = 0;  // valid with end_at
};

struct Publication {
  MonoTime oldest_sensed_at{}, published_at{}, at{};
};

// A message that an executive read.
struct Consumption {
  std::uint64_t tick = 0, sequence = 0, observation_id = 0;
  MonoTime at{};
  std::uint8_t arrival = 0;
  AgeParts age{};
};

// A policy host's way to one command.
struct Answer {
  std::int64_t pid = 0;
  MonoTime infer_begin_at{}, infer_end_at{}, publish_begin_at{}, publish_end_at{};  // the tracer's stamps
  MonoTime inferred_from{}, inferred_to{};                                          // as the command says
  MonoTime outside_sensed_at{};  // unset: no outside sensor, or not traced
};

struct TracedExecutive {
  std::vector<TracedTick> ticks;
  std::vector<Consumption> consumptions;
  std::map<std::uint64_t, Publication> publications;  // by observation id
};

// Work between a begin and an end of one process, tied to nothing else.
struct TracedSpan {
  std::int64_t pid = 0;
  MonoTime begin_at{}, end_at{};  // unset: not in the trace
};

struct ModeChange {
  std::int64_t monitor_pid = 0;
  std::uint64_t tick = 0;
  MonoTime now{};
  std::uint8_t previous_mode = 0, mode = 0, cause = 0;
};

struct Timeline {
  using AnswerKey = std::pair<std::uint64_t, std::uint64_t>;  // observation id, sequence

  void add(const TraceEvent& event);

  MonoTime first_at{}, last_at{};
  std::map<std::int64_t, TracedProcess> processes;  // by pid: every process that said anything
  std::map<std::int64_t, TracedExecutive> executives;
  std::map<AnswerKey, std::vector<Answer>> answers;  // several when several robots are traced at once
  std::vector<TracedSpan> dequeues, drains;
  std::vector<ModeChange> mode_changes;

 private:
  Answer& answer_of(const TraceEvent& event);
  static void end_span(std::vector<TracedSpan>& spans, const TraceEvent& event);
  static void end_tick(std::vector<TracedTick>& ticks, const TraceEvent& event);
};

}  // namespace takt::lab
