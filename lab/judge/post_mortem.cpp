// SPDX-License-Identifier: Apache-2.0
#include "lab/judge/post_mortem.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "evidence/review/counterfactual.hpp"
#include "monitor/judge/fault_classifier.hpp"
#include "monitor/judge/run_metrics.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/recorded_run.hpp"

namespace takt::lab {
namespace {

constexpr std::string_view kSignature = "completed-by:";
constexpr std::size_t kConclusionWords = 3;  // of a conclusion

// That a person wrote below the heading.
std::size_t concluded_words(std::string_view text) {
  const std::size_t begin = text.find(kConclusion);
  if (begin == std::string_view::npos) return 0;
  const std::string_view part = text.substr(begin + kConclusion.size());
  const std::size_t words = words_in(part.substr(0, part.find(kSignature)));
  return part.contains(kToConclude) ? words - words_in(kToConclude) : words;
}

std::string trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r*_");
  if (first == std::string_view::npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(" \t\r*_") - first + 1));
}

int severity(const TickRecordHeader& header) {
  // The stop that ends every recorded run is no failure.
  if (header.mode == header.previous_mode || header.cause == Cause::shutdown) return 0;
  switch (header.mode) {
    case Mode::standby:
    case Mode::arming:
    case Mode::tracking:
      return 0;
    case Mode::degraded:
      return 1;
    case Mode::damped_stop:
    case Mode::fault_latched:
      return 2;
  }
  return 0;
}

std::string show_again(const Artifact& artifact, const evidence::RolloutRow& row) {
  if (!row.run_folder.empty()) return "takt replay " + artifact.folder.path() + "/" + row.run_folder;
  // Not the copy in the artifact: a panel names its robot relative to itself.
  return "takt panel run PANEL.yaml --only " + evidence::rollout_id(row) + " --out again  # PANEL.yaml: SHA-256 " +
         artifact.manifest.panel_sha256;
}

std::expected<std::string, std::string> draft_of(const Artifact& artifact, std::size_t index) {
  const evidence::RolloutRow& row = artifact.rows[index];
  PostMortemDraft draft{.row = row,
                        .row_number = index + 1,
                        .artifact_id = artifact.manifest.artifact_id,
                        .show_again = show_again(artifact, row),
                        .verdicts = {},
                        .incidents = {}};
  if (row.run_folder.empty()) return post_mortem_text(draft);
  const auto run = monitor::open_run(artifact.folder.path() + "/" + row.run_folder);
  if (!run) return std::unexpected(run.error());
  FailureWatch watch;
  incident::IncidentWatch incidents(run->robot);
  const auto scan = monitor::scan_run(*run, {.tick =
                                                 [&](const monitor::RecordedTick& tick) {
                                                   watch.tick(tick.record.header);
                                                   if (auto incident = incidents.tick(tick.record))
                                                     draft.incidents.push_back(std::move(*incident));
                                                 },
                                             .command = {},
                                             .keyframe = {},
                                             .loss = {}});
  if (!scan) return std::unexpected(scan.error());
  evidence::add_counterfactuals(draft.incidents, *run);
  draft.incidents = monitor::by_gravity(std::move(draft.incidents));
  draft.ticks = &watch;
  const auto faults = monitor::classify_run(*run);
  if (!faults) return std::unexpected(faults.error());
  for (const monitor::FaultVerdict& verdict : faults->verdicts) draft.verdicts.push_back(verdict.sentence);
  return post_mortem_text(draft);
}

}  // namespace

void FailureWatch::tick(const TickRecordHeader& header) {
  if (header.mode != header.previous_mode) {
    ++transition_count_;
    if (transitions_.size() < monitor::kListedTransitions) {
      transitions_.push_back({header.tick, header.now, header.previous_mode, header.mode, header.cause});
    }
  }
  latest_.push_back(header);
  if (latest_.size() > kTicksBefore + 1) latest_.pop_front();
  if (severity(header) > scene_.severity) {
    scene_ = {severity(header), {latest_.begin(), latest_.end()}, kTicksAfter};
  } else if (scene_.missing > 0) {
    scene_.ticks.push_back(header);
    --scene_.missing;
  }
}

std::vector<TickRecordHeader> FailureWatch::around() const {
  return scene_.severity > 0 ? scene_.ticks : std::vector<TickRecordHeader>(latest_.begin(), latest_.end());
}

std::expected<bool, std::string> keep_post_mortem(const ArtifactFolder& folder, const evidence::RolloutRow& row,
                                                  std::string_view draft) {
  const std::string path = folder.post_mortem(row);
  std::error_code error;
  std::filesystem::create_directories(folder.post_mortems(), error);
  if (error) return std::unexpected("cannot make " + folder.post_mortems() + ": " + error.message());
  if (std::filesystem::exists(path, error)) return false;
  if (auto written = monitor::replace_file(path, std::string(draft)); !written) return std::unexpected(written.error());
  return true;
}

std::expected<std::size_t, std::string> draft_post_mortems(const Artifact& artifact) {
  std::size_t drafted = 0;
  for (std::size_t index = 0; index < artifact.rows.size(); ++index) {
    const evidence::RolloutRow& row = artifact.rows[index];
    if (row.success || post_mortem_state(artifact, row) != PostMortemState::missing) continue;
    const auto text = draft_of(artifact, index);
    if (!text) return std::unexpected("row " + std::to_string(index + 1) + ": " + text.error());
    if (const auto kept = keep_post_mortem(artifact.folder, row, *text); !kept) return std::unexpected(kept.error());
    ++drafted;
  }
  return drafted;
}

std::size_t words_in(std::string_view text) {
  std::size_t words = 0;
  bool inside = false;
  for (const char c : text) {
    const bool letter = std::isgraph(static_cast<unsigned char>(c)) != 0 || static_cast<unsigned char>(c) >= 0x80;
    words += letter && !inside ? 1U : 0U;
    inside = letter;
  }
  return words;
}

std::string completed_by(std::string_view post_mortem) {
  for (std::size_t begin = 0; begin < post_mortem.size();) {
    const std::size_t end = std::min(post_mortem.find('\n', begin), post_mortem.size());
    const std::string_view line = post_mortem.substr(begin, end - begin);
    if (line.starts_with(kSignature)) return trimmed(line.substr(kSignature.size()));
    begin = end + 1;
  }
  return {};
}

PostMortemState post_mortem_state(const Artifact& artifact, const evidence::RolloutRow& row) {
  const auto text = monitor::read_file(artifact.folder.post_mortem(row));
  if (!text) return PostMortemState::missing;
  if (completed_by(*text).empty()) return PostMortemState::drafted;
  return concluded_words(*text) < kConclusionWords ? PostMortemState::signed_only : PostMortemState::completed;
}

}  // namespace takt::lab
