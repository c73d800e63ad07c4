// SPDX-License-Identifier: Apache-2.0
// The words of a drafted post-mortem, in Markdown.
#include <fmt/format.h>

#include "lab/judge/post_mortem.hpp"

namespace takt::lab {
namespace {

std::string number_or_none(const std::optional<double>& value, std::string_view unit) {
  return value ? fmt::format("{:.4g} {}", *value, unit) : "none";
}

std::string facts(const PostMortemDraft& draft) {
  const evidence::RolloutRow& row = draft.row;
  std::string text = "| | |\n|---|---|\n";
  const auto add = [&](std::string_view name, const std::string& value) {
    text += fmt::format("| {} | {} |\n", name, value);
  };
  add("panel", fmt::format("{}, SHA-256 {}", row.panel, row.panel_sha256));
  if (draft.row_number != 0) {
    add("artifact, row",
        fmt::format("{}, row {}", draft.artifact_id.empty() ? "unfinished" : draft.artifact_id, draft.row_number));
  }
  add("task, method, seed", fmt::format("{}, {}, {}", row.task, row.method, row.seed));
  add("perturbation", fmt::format("{} at dose {:g}", row.perturbation, row.dose));
  add("failure", row.failure_label);
  add("monitor state at the end", fmt::format("{}, last cause {}", name(row.final_mode), name(row.final_cause)));
  add("command age p95 at first use", number_or_none(row.age_per_command.total.p95_ms, "ms"));
  add("missed commands", fmt::format("{} of {}", row.misses_per_command.misses, row.misses_per_command.count));
  if (row.rearms != 0) add("armed again by the operator", fmt::format("{} times", row.rearms));
  add("tracking error rms", fmt::format("{:.4g} m", row.tracking_error_rms_m));
  add("recovery", number_or_none(row.recovery_s, "s"));
  return text;
}

std::string causes(const PostMortemDraft& draft) {
  if (!draft.verdicts.empty()) {
    constexpr std::size_t kShown = 10;
    std::string text;
    for (std::size_t index = 0; index < draft.verdicts.size() && index < kShown; ++index) {
      text += fmt::format("- {}\n", draft.verdicts[index]);
    }
    if (draft.verdicts.size() > kShown) text += fmt::format("- and {} more\n", draft.verdicts.size() - kShown);
    return text;
  }
  return fmt::format("{}: ended in {} because of {}.{}\n", draft.row.failure_label, name(draft.row.final_mode),
                     name(draft.row.final_cause),
                     draft.ticks == nullptr ? " No records were kept; the command below makes them again." : "");
}

// Every stop and fault in one sentence, with what came before it.
std::string incidents(const PostMortemDraft& draft) {
  constexpr std::size_t kShown = 10;
  std::string text;
  for (std::size_t index = 0; index < draft.incidents.size() && index < kShown; ++index) {
    const incident::Incident& incident = draft.incidents[index];
    text += fmt::format("- {}\n", incident.sentence);
    for (const incident::IncidentLink& link : incident.chain)
      text +=
          fmt::format("  - tick {}, {:+.1f} ms: {}\n", link.tick, (link.at - incident.at).milliseconds(), link.what);
    if (!incident.counterfactual.empty()) text += fmt::format("  - {}\n", incident.counterfactual);
  }
  if (draft.incidents.size() > kShown) text += fmt::format("- and {} more\n", draft.incidents.size() - kShown);
  return text.empty() ? "" : "\n## Why it stopped\n\n" + text;
}

std::string timeline(const FailureWatch& ticks) {
  if (ticks.transitions().empty()) return "No change of mode.\n";
  std::string text = "| tick | s | from | to | cause |\n|---:|---:|---|---|---|\n";
  const MonoTime start = ticks.transitions().front().at;
  for (const monitor::Transition& each : ticks.transitions()) {
    text += fmt::format("| {} | {:+.3f} | {} | {} | {} |\n", each.tick, (each.at - start).seconds(), name(each.from),
                        name(each.to), name(each.cause));
  }
  const std::uint64_t hidden = ticks.transition_count() - ticks.transitions().size();
  return hidden == 0 ? text : text + fmt::format("\nand {} more\n", hidden);
}

std::string ticks_table(const FailureWatch& ticks) {
  std::string text =
      "Ages in ms: total = sense + queue + infer + publish + hold.\n\n"
      "| tick | mode | command | freshness | total | sense | queue | infer | publish | hold | arrival | late us |\n"
      "|---:|---|---:|---|---:|---:|---:|---:|---:|---:|---|---:|\n";
  for (const TickRecordHeader& tick : ticks.around()) {
    const AgeParts& age = tick.age;
    const bool changed = tick.mode != tick.previous_mode;
    text += fmt::format("| {} | {}{} | {} | {} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {} | {:.0f} |\n",
                        tick.tick, name(tick.mode), changed ? fmt::format(" ({})", name(tick.cause)) : "",
                        tick.seats[Seat::policy].command_sequence, name(tick.seats[Seat::policy].freshness),
                        age.total().milliseconds(), age.sense.milliseconds(), age.queue.milliseconds(),
                        age.infer.milliseconds(), age.publish.milliseconds(), age.hold.milliseconds(),
                        name(tick.seats[Seat::policy].arrival), tick.lateness.milliseconds() * 1000);
  }
  return text;
}

}  // namespace

std::string post_mortem_text(const PostMortemDraft& draft) {
  std::string text = fmt::format("# Post-mortem: {}\n\n{}\n## Cause, as the records show it\n\n{}",
                                 evidence::rollout_id(draft.row), facts(draft), causes(draft));
  text += incidents(draft);
  if (draft.ticks != nullptr) {
    text += "\n## Timeline\n\n" + timeline(*draft.ticks);
    text += "\n## The ticks around the failure\n\n" + ticks_table(*draft.ticks);
  }
  text += fmt::format("\n## See it again\n\n```sh\n{}\n```\n", draft.show_again);
  // The part that no program can write.
  return text + fmt::format("\n{}\n{}\n\n\ncompleted-by:\n", kConclusion, kToConclude);
}

}  // namespace takt::lab
