// SPDX-License-Identifier: Apache-2.0
// Does what OpenTelemetry was told (otlp_traces.jsonl of a run folder, docs/opentelemetry.md) agree with the records?
#pragma once

#include <expected>
#include <istream>
#include <string>
#include <vector>

#include "lab/trace/record_check.hpp"

namespace takt::lab {

// A trace as it was exported: one command at its first use.
struct ToldCommand {
  std::uint64_t tick = 0, sequence = 0;
  Duration age{};    // as the root span states it
  AgeParts parts{};  // from the spans; hold is none yet
};

// The error is one sentence: a line that is no export request, or a command without one of its spans.
std::expected<std::vector<ToldCommand>, std::string> read_told_commands(std::istream& lines);

struct OtlpCheck {
  std::uint64_t commands = 0;    // compared
  std::uint64_t unrecorded = 0;  // told, but the run has no record of their tick
  std::uint64_t disagreement_count = 0;
  std::vector<Disagreement> disagreements;  // the first RecordCheck::kListed
  [[nodiscard]] bool agrees() const { return commands != 0 && disagreement_count == 0; }
};

// `records` ascending by tick. Pure.
OtlpCheck check_told_commands(const std::vector<ToldCommand>& told, const std::vector<TickFacts>& records);

std::string otlp_text(const OtlpCheck& check);

}  // namespace takt::lab
