// SPDX-License-Identifier: Apache-2.0
// The short post-mortem that every failed rollout must have: drafted by the program, completed by a person.
//
// A draft states what the row and, where there are records, the ticks say: cause, timeline of transitions, the twenty
// ticks around the failure, and the command that shows it again. It ends with a line `completed-by:`; a post-mortem
// counts as completed when a name stands behind it, and a sentence below its heading `Conclusion`. A file that exists
// is never overwritten. `takt panel run` drafts them as rollouts fail; `takt audit --draft` those that are missing.
#pragma once

#include <cstddef>
#include <deque>
#include <expected>
#include <string>
#include <vector>

#include "executive/contract/tick_record.hpp"
#include "executive/incident/incident.hpp"
#include "lab/artifact/artifact.hpp"
#include "monitor/record/run_messages.hpp"

namespace takt::lab {

inline constexpr std::size_t kTicksBefore = 10, kTicksAfter = 10;

// Watches a rollout's ticks and keeps what a post-mortem shows. The failure is the first tick that enters damped_stop
// or fault_latched; without one the first that enters degraded; without one the last tick. Thread rule: one thread.
class FailureWatch {
 public:
  void tick(const TickRecordHeader& header);
  // Around the failure, oldest first; at most kTicksBefore + 1 + kTicksAfter.
  [[nodiscard]] std::vector<TickRecordHeader> around() const;
  // The first kListedTransitions of them.
  [[nodiscard]] const std::vector<monitor::Transition>& transitions() const { return transitions_; }
  [[nodiscard]] std::uint64_t transition_count() const { return transition_count_; }

 private:
  struct Scene {
    int severity = 0;  // of the failure it shows; 0: none yet
    std::vector<TickRecordHeader> ticks;
    std::size_t missing = 0;  // ticks still to come behind the failure
  };
  std::deque<TickRecordHeader> latest_;
  Scene scene_;
  std::vector<monitor::Transition> transitions_;
  std::uint64_t transition_count_ = 0;
};

struct PostMortemDraft {
  const evidence::RolloutRow& row;
  std::size_t row_number = 0;                   // in rollouts.jsonl, from 1; 0: not known yet
  std::string artifact_id{};                    // empty: unfinished
  std::string show_again{};                     // command line that replays or repeats the rollout
  const FailureWatch* ticks = nullptr;          // null: no records were kept
  std::vector<std::string> verdicts;            // of the fault classifier, a sentence each
  std::vector<incident::Incident> incidents{};  // the gravest first
};
std::string post_mortem_text(const PostMortemDraft& draft);
// What the draft has below its heading `Conclusion`, before a person writes.
inline constexpr std::string_view kConclusion = "## Conclusion\n";
inline constexpr std::string_view kToConclude =
    "What went wrong, whether the response was the right one, and what changes because of it:";

// Writes postmortems/ID.md for every failed row that has none, from its run folder where one was kept. Returns how
// many.
std::expected<std::size_t, std::string> draft_post_mortems(const Artifact& artifact);

// Keeps a draft as the row's postmortems/ID.md; false: there is one already, which stays as it is.
std::expected<bool, std::string> keep_post_mortem(const ArtifactFolder& folder, const evidence::RolloutRow& row,
                                                  std::string_view draft);

enum class PostMortemState : std::uint8_t {
  missing,
  drafted,
  signed_only,  // a name, and no conclusion
  completed,
};
PostMortemState post_mortem_state(const Artifact& artifact, const evidence::RolloutRow& row);
// Who completed it; empty: it is not completed.
std::string completed_by(std::string_view post_mortem);

std::size_t words_in(std::string_view text);

}  // namespace takt::lab
