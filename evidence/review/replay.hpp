// SPDX-License-Identifier: Apache-2.0
// Replay: recorded inputs go through the same pure decision again, and every byte of every record must come out.
//
// It starts from the state before tick 1 when the recording has it, else from a keyframe, and starts again at the next
// keyframe behind a gap or a mismatch; ticks between are counted as not judged. Every keyframe met on the way must
// equal the recomputed state. Each record also carries a checksum made when it was recorded, so that an altered record
// is found even where the decision does not depend on the altered field; one flipped bit is located and named.
// What the manifest says was recorded and the file no longer holds, at its end or between, is counted as missing; what
// the recorder saw after it had to stop, as unrecorded.
// Of a run of an earlier version what this one records besides is not compared, nor are keyframes of another layout;
// one that lacks an input, or holds what this version does not know, is refused. Of a refused message of which only the
// header was kept, what was found in its values is taken from the record.
#pragma once

#include <cstdint>
#include <expected>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "monitor/record/recorded_run.hpp"

namespace takt::evidence {

struct Mismatch {
  std::uint64_t tick = 0;
  std::string field;       // "q_estimate", "command values[3]", "keyframe"
  std::string where;       // joint or bus name; empty: the tick's own field
  std::string recorded;    // value in the file
  std::string recomputed;  // what replay got, or what the checksum says it was; empty: unknown
  bool altered = false;    // the file was changed after recording; else the decision differs
};

struct ReplayReport {
  std::uint64_t ticks = 0;       // recorded, from the starting tick on
  std::uint64_t identical = 0;   // reproduced bit for bit
  std::uint64_t mismatches = 0;  // ticks that did not
  std::uint64_t not_judged = 0;  // behind a gap or a mismatch, before the next keyframe
  std::uint64_t by_header = 0;   // read a refused message of which only the header was kept
  std::uint64_t missing = 0;     // recorded, says the manifest, and not in the file, wherever replay started
  std::uint64_t unrecorded = 0;  // after recording stopped, says the manifest
  std::string stopped_because;   // why it did; empty: it did not
  std::uint64_t gaps = 0;        // breaks in the recorded ticks or their commands
  std::uint64_t keyframes = 0;   // compared with the recomputed state, equal
  std::uint64_t started_at = 0;  // first tick judged; 0 none
  std::uint64_t last_tick = 0;   // that the file holds; 0 none
  std::string made_by;           // version of the executive, where it was built of other sources; empty: not so
  std::vector<std::string> not_compared;  // outputs that this version records and the run's did not yet
  std::optional<Mismatch> first;
  monitor::McapReport file;
  [[nodiscard]] bool reproduces() const { return mismatches == 0 && identical > 0 && file.damaged_chunks == 0; }
  // No tick of the run, and no output of one, was left unjudged.
  [[nodiscard]] bool is_whole() const {
    return not_judged == 0 && missing == 0 && unrecorded == 0 && not_compared.empty() && file.finished;
  }
};

// `from`: first tick of interest; replay starts at the last keyframe before it. The error is one sentence.
std::expected<ReplayReport, std::string> replay(const monitor::RecordedRun& run, std::uint64_t from);

std::string replay_text(const ReplayReport& report);
nlohmann::ordered_json to_json(const ReplayReport& report);

}  // namespace takt::evidence
