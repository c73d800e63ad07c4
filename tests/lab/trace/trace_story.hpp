// SPDX-License-Identifier: Apache-2.0
// A trace whose every instant is known, as events and as the records of the same run: a tick each millisecond that
// works 150 us; each twentieth publishes an observation after 100 us, whose oldest sample is 300 us older than the tick
// and which a camera makes 15 ms older; a policy host begins 200 us later, infers 400 us, and the next tick uses the
// command.
#pragma once

#include <functional>
#include <stdexcept>
#include <vector>

#include "lab/trace/record_check.hpp"

namespace takt::monitor::testing {

inline constexpr std::int64_t kExecutive = 10, kHost = 20, kMonitor = 30;
inline constexpr std::uint64_t kConfig = 0xABCD;
inline constexpr std::uint64_t kTicks = 100, kEvery = 20;

constexpr MonoTime start_of(std::uint64_t tick) {
  return MonoTime{1'000'000'000} + milliseconds(static_cast<std::int64_t>(tick));
}
constexpr MonoTime sensed_for(std::uint64_t tick) {
  return start_of(tick) - microseconds(300);
}
constexpr MonoTime outside_for(std::uint64_t tick) {
  return start_of(tick) - milliseconds(15);
}

struct Story {
  std::vector<lab::TraceEvent> events;
  std::vector<lab::TickFacts> records;

  lab::TraceEvent& say(lab::EventName name, std::int64_t pid, MonoTime at) {
    lab::TraceEvent event;
    event.name = name;
    event.pid = pid;
    event.at = at;
    events.push_back(event);
    return events.back();
  }
  [[nodiscard]] lab::Timeline timeline() const {
    lab::Timeline timeline;
    for (const lab::TraceEvent& event : events) timeline.add(event);
    return timeline;
  }
  std::size_t drop(const std::function<bool(const lab::TraceEvent&)>& which) { return std::erase_if(events, which); }
  std::size_t drop(lab::EventName name) {
    return drop([name](const lab::TraceEvent& event) { return event.name == name; });
  }
  lab::TraceEvent& nth(lab::EventName name, std::size_t n) {
    for (lab::TraceEvent& event : events) {
      if (event.name == name && n-- == 0) return event;
    }
    throw std::out_of_range("no such event");
  }
};

inline constexpr std::uint64_t kCommands = kTicks / kEvery - 1;  // the last observation's command is used after the end

void introduce(Story& story, const char* program, std::int64_t pid, std::uint64_t config);
// Events of a policy host that answers observation `id` of `tick` with a command of the same number.
void answer(Story& story, std::int64_t host, std::uint64_t tick, std::uint64_t id);
// Events and record of a tick of the executive `pid`.
void run_tick(Story& story, std::int64_t pid, std::uint64_t tick);
Story whole_story();

}  // namespace takt::monitor::testing
