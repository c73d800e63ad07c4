// SPDX-License-Identifier: Apache-2.0
// Reads an LTTng trace's Takt events, in order of time over all processes and cores. The one place that knows
// libbabeltrace2; what it hands out are plain values.
//
// A folder is what `takt trace start` or one snapshot wrote: every CTF trace below it (one per user, one of the kernel)
// is read together. Events of other providers are counted. Events that LTTng had to discard are reported where the
// trace says so. Errors are one sentence. Thread rule: one reader at a time.
#pragma once

#include <cstdint>
#include <expected>
#include <functional>
#include <string>
#include <vector>

#include "lab/trace/trace_event.hpp"

namespace takt::lab {

// Events, or whole packets of them, that did not make it into the trace.
struct TraceLoss {
  enum class What : std::uint8_t { events, packets } what = What::events;
  std::uint64_t count = 0;  // 0: the trace does not say how many
  MonoTime from, to;        // between these instants; unset when the trace does not say
  friend bool operator==(const TraceLoss&, const TraceLoss&) = default;
};

struct TraceReading {
  std::vector<std::string> folders;     // the CTF traces that were read
  std::uint64_t events = 0;             // of Takt
  std::uint64_t other_events = 0;       // of other providers and of the kernel
  std::vector<std::string> unreadable;  // kinds of events left out, of another version of Takt: what they lack
  std::vector<TraceLoss> losses;
};

std::expected<TraceReading, std::string> read_trace(const std::string& directory,
                                                    const std::function<void(const TraceEvent&)>& visit);

}  // namespace takt::lab
