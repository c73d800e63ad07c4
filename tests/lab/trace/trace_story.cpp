// SPDX-License-Identifier: Apache-2.0
#include "tests/lab/trace/trace_story.hpp"

#include <algorithm>

namespace takt::monitor::testing {
namespace {

AgeParts parts_at(std::uint64_t observed_tick, std::uint64_t tick) {
  const MonoTime observed = start_of(observed_tick) + microseconds(100);
  return {observed - outside_for(observed_tick), microseconds(200), microseconds(400), microseconds(300),
          start_of(tick) - start_of(observed_tick + 1)};
}

}  // namespace

void introduce(Story& story, const char* program, std::int64_t pid, std::uint64_t config) {
  lab::TraceEvent& init = story.say(lab::EventName::init, pid, start_of(0));
  init.process = program;
  init.config_hash = config;
}

void answer(Story& story, std::int64_t host, std::uint64_t tick, std::uint64_t id) {
  const MonoTime from = start_of(tick) + microseconds(300);
  const auto event = [&](lab::EventName name, MonoTime at) -> lab::TraceEvent& {
    lab::TraceEvent& said = story.say(name, host, at);
    said.observation_id = id;
    said.sequence = id;
    return said;
  };
  event(lab::EventName::infer_begin, from + microseconds(1)).stamp = from;
  event(lab::EventName::infer_end, from + microseconds(401)).stamp = from + microseconds(400);
  event(lab::EventName::publish_begin, from + microseconds(450)).sensed = outside_for(tick);
  event(lab::EventName::publish_end, from + microseconds(500));
}

void run_tick(Story& story, std::int64_t pid, std::uint64_t tick) {
  const std::uint64_t observed = tick <= kEvery ? 0 : (tick - 1) / kEvery * kEvery;  // of the command in use
  lab::TraceEvent& begin = story.say(lab::EventName::tick_begin, pid, start_of(tick) + microseconds(1));
  begin.tick = tick;
  begin.stamp = start_of(tick);
  const AgeParts age = observed == 0 ? AgeParts{} : parts_at(observed, tick);
  if (tick % kEvery == 0) {
    lab::TraceEvent& published =
        story.say(lab::EventName::observation_published, pid, start_of(tick) + microseconds(101));
    published.tick = tick;
    published.observation_id = tick / kEvery;
    published.sensed = sensed_for(tick);
    published.published = start_of(tick) + microseconds(100);
  }
  if (tick % kEvery == 1 && tick > kEvery) {
    lab::TraceEvent& consumed = story.say(lab::EventName::command_consumed, pid, start_of(tick) + microseconds(60));
    consumed.tick = tick;
    consumed.sequence = consumed.observation_id = observed / kEvery;
    consumed.arrival = static_cast<std::uint8_t>(Arrival::accepted);
    consumed.age = age;
  }
  lab::TraceEvent& end = story.say(lab::EventName::tick_end, pid, start_of(tick) + microseconds(150));
  end.tick = tick;
  end.sequence = observed / kEvery;
  end.age_total = age.total();
  end.mode = static_cast<std::uint8_t>(Mode::tracking);
  const Freshness freshness = observed == 0 ? Freshness::missing : Freshness::fresh;
  end.freshness = static_cast<std::uint8_t>(freshness);
  lab::TickFacts facts;
  facts.tick = tick;
  facts.now = start_of(tick);
  facts.age = age;
  facts.sequence = end.sequence;
  facts.mode = Mode::tracking;
  facts.freshness = freshness;
  story.records.push_back(facts);
}

Story whole_story() {
  Story story;
  introduce(story, "takt-executive", kExecutive, kConfig);
  introduce(story, "takt-policy-host", kHost, kConfig);
  introduce(story, "takt-monitor", kMonitor, kConfig);
  for (std::uint64_t tick = 1; tick <= kTicks; ++tick) {
    run_tick(story, kExecutive, tick);
    if (tick % kEvery == 0) answer(story, kHost, tick, tick / kEvery);
  }
  return story;
}

}  // namespace takt::monitor::testing
