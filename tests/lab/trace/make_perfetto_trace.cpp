// SPDX-License-Identifier: Apache-2.0
// make_perfetto_trace FILE: exports the constructed trace for perfetto_check.mjs; it also begins in the middle and has
// a publication missing, as a flight recorder's does.
#include <fstream>

#include "lab/trace/perfetto.hpp"
#include "tests/lab/trace/trace_story.hpp"

int main(int argc, char** argv) {
  using namespace takt::lab;
  using namespace takt::monitor::testing;
  if (argc != 2) return 64;
  Story story = whole_story();
  TraceEvent& change = story.say(EventName::mode_changed, kMonitor, start_of(kTicks + 1));
  change.stamp = start_of(kTicks);
  change.previous_mode = static_cast<std::uint8_t>(takt::Mode::tracking);
  change.mode = static_cast<std::uint8_t>(takt::Mode::degraded);
  change.cause = static_cast<std::uint8_t>(takt::Cause::contract_violated);
  story.drop([](const TraceEvent& e) { return e.pid == kHost && e.at < start_of(20) + takt::microseconds(400); });
  story.drop([](const TraceEvent& e) { return e.name == EventName::publish_end && e.sequence == 3; });
  const Timeline timeline = story.timeline();
  std::ofstream out(argv[1]);
  write_perfetto(timeline, chains_of(timeline, kExecutive), kExecutive, [&out](std::string_view text) { out << text; });
  return out.good() ? 0 : 1;
}
