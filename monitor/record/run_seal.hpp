// SPDX-License-Identifier: Apache-2.0
// seal.json of a run folder: what its files were when the recorder wrote them.
//
//   segments   of ticks.mcap, can.log.zst and transitions.jsonl, 10 s each: bytes, when it ended, SHA-256; of
//   events.jsonl,
//              which another process writes, one of what it held when the run was closed
//   files      SHA-256 of manifest.json, config.yaml, drives.json and every image, once the run is closed
//
// What the recorder writes is sealed on its way to the disk, never as it lies there later. The seal is replaced every
// minute and at the end; metrics.json and report.html are computed from the run and are no part of it. A seal has no
// key: it shows an edit to who kept the seal, or its signature (takt seal).
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "monitor/record/run_folder.hpp"
#include "monitor/record/segment_seal.hpp"

namespace takt::monitor {

inline constexpr const char* kRunSealSchema = "takt.run_seal/1";

struct GrownFile {
  std::string_view name;  // in the folder
  const std::vector<SealedSegment>& segments;
};

// The text of seal.json. `closed`: the run ended, and its other files are what they will be.
std::expected<std::string, std::string> run_seal_text(const RunFolder& folder, const std::string& run_id, bool closed,
                                                      const std::vector<GrownFile>& grown);

struct CheckedSeal {
  bool closed = false;  // false: the recorder was ended before it closed the run
  std::size_t files = 0, segments = 0;
  std::uint64_t events_behind = 0;   // bytes of events.jsonl that were written after the run was closed: not sealed
  std::vector<std::string> altered;  // sentences: the first of each file that is not as it was recorded
};
// The error: there is no seal, or it is none of this version.
std::expected<CheckedSeal, std::string> check_run_seal(const RunFolder& folder);
// How much of events.jsonl is sealed; none: no seal was closed.
std::optional<std::uint64_t> sealed_event_bytes(const RunFolder& folder);

}  // namespace takt::monitor
