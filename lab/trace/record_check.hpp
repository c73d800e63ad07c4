// SPDX-License-Identifier: Apache-2.0
// Does a trace tell the ages that the run's records hold? Every age is put together anew from the trace's instants
// across processes and compared with the recorded one, besides the ages that the trace's own events state. Pure.
//
// Ages that cannot be put together (their observation or answer is not in the trace) are counted. Parts use the
// instants as the executive believes them: a policy's claims are limited to observation..use.
#pragma once

#include <cstdint>
#include <expected>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "lab/trace/command_chain.hpp"

namespace takt::lab {

inline constexpr Duration kAgreement = microseconds(20);

// What the review needs of a recorded tick.
struct TickFacts {
  std::uint64_t tick = 0;
  MonoTime now{};
  AgeParts age{};
  std::uint64_t sequence = 0;  // of the command in use
  Mode mode = Mode::standby;
  Freshness freshness = Freshness::missing;
  OverrunCause overrun_cause = OverrunCause::none;  // of the period before
  Cause cause = Cause::none;
};

struct Disagreement {
  std::uint64_t tick = 0;
  std::string_view what;                  // "age", "sense", "mode", ...
  std::int64_t traced = 0, recorded = 0;  // ns, or the number of the mode and the like
};

struct RecordCheck {
  std::uint64_t ticks = 0;        // compared
  std::uint64_t ages = 0;         // put together from the trace and compared
  std::uint64_t commands = 0;     // whose parts were put together and compared
  std::uint64_t underivable = 0;  // ages that the trace has too few events for
  std::uint64_t unrecorded = 0;   // traced ticks that the run has no record of
  Duration largest{};             // difference of an age
  Duration tracer_delay{};        // median from a tick's instant to the tracer's stamp of its begin
  std::uint64_t disagreement_count = 0;
  std::vector<Disagreement> disagreements;  // the first kListed
  static constexpr std::size_t kListed = 10;
  // Something was compared, nothing differs by more than kAgreement, and both clocks are one.
  [[nodiscard]] bool agrees() const {
    return ticks != 0 && disagreement_count == 0 && tracer_delay <= kAgreement &&
           tracer_delay >= Duration{-kAgreement.ns};
  }
};

// `records` ascending by tick.
RecordCheck check_records(const TracedExecutive& executive, const Chains& chains,
                          const std::vector<TickFacts>& records);

// The executive of the trace that this run records: the one with a tick at the very instant of the record.
std::expected<std::int64_t, std::string> executive_of(const Timeline& timeline, const std::vector<TickFacts>& records);

}  // namespace takt::lab
