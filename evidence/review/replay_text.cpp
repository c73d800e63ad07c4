// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "config/printable.hpp"
#include "evidence/review/replay.hpp"
#include "executive/contract/version.hpp"

namespace takt::evidence {
namespace {

std::string mismatch_text(const Mismatch& mismatch) {
  std::string text = fmt::format("tick {}: {}", mismatch.tick, mismatch.field);
  if (!mismatch.where.empty()) text += fmt::format(" of {}", mismatch.where);
  if (!mismatch.recorded.empty()) {
    text += fmt::format(" is recorded as {}, {} {}", mismatch.recorded,
                        mismatch.altered ? "its checksum was made for" : "recomputed as", mismatch.recomputed);
  }
  return text + (mismatch.altered ? " (altered after recording)" : "");
}

}  // namespace

std::string replay_text(const ReplayReport& report) {
  std::string text = fmt::format("{} of {} ticks reproduce bit for bit", report.identical, report.ticks);
  if (report.keyframes != 0) text += fmt::format("; {} keyframes equal the recomputed state", report.keyframes);
  text += '\n';
  if (report.not_judged != 0) {
    text += fmt::format("{} ticks could not be judged: {} gaps; replay starts again at the next keyframe\n",
                        report.not_judged, report.gaps);
  }
  if (report.missing != 0)
    text += fmt::format("{} ticks are missing: the manifest says that more were recorded than ticks.mcap holds\n",
                        report.missing);
  if (report.unrecorded != 0)
    text += fmt::format("{} ticks are not in this folder: recording stopped: {}\n", report.unrecorded,
                        config::printable(report.stopped_because));
  if (report.by_header != 0) {
    text += fmt::format("{} refused messages were kept by their header: what was found in their values is not judged\n",
                        report.by_header);
  }
  if (report.file.damaged_chunks != 0) {
    text += fmt::format("{} chunks of ticks.mcap are damaged and were skipped\n", report.file.damaged_chunks);
  }
  if (!report.file.finished) {
    text += fmt::format(
        "ticks.mcap was not closed: {} bytes at its end are no whole record, and what came after tick {} is not in "
        "this "
        "folder\n",
        report.file.unread_bytes, report.last_tick);
  }
  if (!report.not_compared.empty())
    text += fmt::format("not compared, as the run has it not: {}\n", fmt::join(report.not_compared, ", "));
  if (report.mismatches != 0) text += fmt::format("{} do not reproduce; the first:\n", report.mismatches);
  if (report.first) text += "  " + mismatch_text(*report.first) + "\n";
  if (!report.made_by.empty())
    text += fmt::format("takt {} made it, of other sources than {} has\n", report.made_by, version());
  return text;
}

nlohmann::ordered_json to_json(const ReplayReport& report) {
  nlohmann::ordered_json json{{"schema", "takt.replay/1"},
                              {"reproduces", report.reproduces()},
                              {"ticks", report.ticks},
                              {"identical", report.identical},
                              {"mismatches", report.mismatches},
                              {"not_judged", report.not_judged},
                              {"missing", report.missing},
                              {"unrecorded", report.unrecorded},
                              {"by_header", report.by_header},
                              {"gaps", report.gaps},
                              {"keyframes_equal", report.keyframes},
                              {"started_at", report.started_at},
                              {"made_by_other_sources", nullptr},
                              {"file_finished", report.file.finished},
                              {"damaged_chunks", report.file.damaged_chunks},
                              {"first_mismatch", nullptr}};
  json["not_compared"] = report.not_compared;
  if (!report.made_by.empty()) json["made_by_other_sources"] = report.made_by;
  if (report.first) {
    json["first_mismatch"] = {{"tick", report.first->tick},
                              {"field", report.first->field},
                              {"where", report.first->where},
                              {"recorded", report.first->recorded},
                              {"recomputed", report.first->recomputed},
                              {"altered", report.first->altered}};
  }
  return json;
}

}  // namespace takt::evidence
