// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "lab/trace/review.hpp"

namespace takt::lab {
namespace {

double ms(Duration span) {
  return span.milliseconds();
}

std::string processes(const Timeline& timeline) {
  std::string text;
  for (const auto& [pid, process] : timeline.processes)
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", process.program.empty() ? "?" : process.program, pid);
  return text;
}

std::string losses(const TraceReading& reading) {
  if (reading.losses.empty()) return "lost          none\n";
  std::string text;
  for (const TraceLoss& loss : reading.losses) {
    const std::string_view what = loss.what == TraceLoss::What::events ? "events" : "packets of events";
    text += fmt::format("{:<14}{} {} discarded by LTTng", text.empty() ? "LOST" : "",
                        loss.count == 0 ? "an unknown number of" : std::to_string(loss.count), what);
    if (loss.from.is_set())
      text += fmt::format(" between {:.6f} s and {:.6f} s", (loss.from - MonoTime{}).seconds(),
                          (loss.to - MonoTime{}).seconds());
    text += '\n';
  }
  return text + "              what they would have told is missing below\n";
}

std::string commands(const Chains& chains) {
  std::string text = fmt::format("commands      {} accepted, {} refused\n", chains.accepted.size(), chains.refused);
  const auto gap = [&text](std::uint64_t count, std::string_view what) {
    if (count != 0) text += fmt::format("              {} without {} in the trace\n", count, what);
  };
  gap(chains.without_observation, "their observation");
  gap(chains.without_inference, "their inference");
  gap(chains.without_publish, "their publication");
  gap(chains.without_tick, "the begin of their tick");
  return text;
}

std::string row(std::string_view label, const monitor::Quantiles& q) {
  if (q.count == 0) return fmt::format("  {:<10} not in the trace\n", label);
  return fmt::format("  {:<10}{:>9}{:>11.4f}{:>11.4f}{:>11.4f}{:>11.4f}\n", label, q.count, q.p50 * 1e-6, q.p95 * 1e-6,
                     q.p99 * 1e-6, q.max * 1e-6);
}

std::string stages(const TraceReview& review) {
  std::string text =
      fmt::format("\nlatency, ms\n  {:<10}{:>9}{:>11}{:>11}{:>11}{:>11}\n", "", "count", "p50", "p95", "p99", "max");
  for (std::size_t stage = 0; stage < kStageNames.size(); ++stage)
    text += row(kStageNames[stage], review.stages[stage]);
  return text + row("wake-up", review.lateness) + row("tick", review.tick_work) + row("dequeue", review.looks) +
         row("drain", review.drains);
}

std::string context(const CommandContext& context) {
  std::string text;
  for (const Mode mode : context.modes) text += fmt::format("{}{}", text.empty() ? "" : " -> ", name(mode));
  text += fmt::format(", wake-up at worst {:.3f} ms late ({} late), longest tick {:.3f} ms", ms(context.worst_lateness),
                      context.late_wakeups, ms(context.longest_tick));
  if (context.skipped_periods != 0) text += fmt::format(", {} periods skipped", context.skipped_periods);
  for (std::size_t cause = 1; cause < context.overruns.size(); ++cause) {
    if (context.overruns[cause] != 0)
      text += fmt::format(", overrun: {} {}", name(static_cast<OverrunCause>(cause)), context.overruns[cause]);
  }
  if (context.refused_messages != 0) text += fmt::format(", {} messages refused", context.refused_messages);
  if (context.untraced_ticks != 0) text += fmt::format(", {} ticks not in the trace", context.untraced_ticks);
  return text;
}

std::string worst(const TraceReview& review) {
  if (review.worst.empty()) return "";
  std::string text = fmt::format("\nslowest commands, from sensing to the bus, ms\n  {:>10}{:>12}{:>10}", "sequence",
                                 "observation", "tick");
  for (const std::string_view stage : kStageNames) text += fmt::format("{:>9}", stage);
  text += '\n';
  for (const WorstCommand& each : review.worst) {
    text += fmt::format("  {:>10}{:>12}{:>10}", each.chain.sequence, each.chain.observation_id, each.chain.tick);
    for (std::size_t stage = 0; stage < kStageNames.size(); ++stage) {
      const auto spent = stage_of(each.chain, static_cast<Stage>(stage));
      text += spent ? fmt::format("{:>9.3f}", ms(*spent)) : fmt::format("{:>9}", "?");
    }
    text += fmt::format("\n             mostly {}; ticks {} to {}: {}\n",
                        kStageNames[static_cast<std::size_t>(each.longest)], each.context.first_tick,
                        each.context.last_tick, context(each.context));
  }
  return text;
}

std::string check_text(const RecordCheck& check) {
  std::string text = fmt::format(
      "\nrecords       {} ticks compared; {} ages and the parts of {} commands put together from the trace\n"
      "              largest difference {:.3f} us; tracer's stamp {:.3f} us after the tick's instant (median)\n",
      check.ticks, check.ages, check.commands, static_cast<double>(check.largest.ns) * 1e-3,
      static_cast<double>(check.tracer_delay.ns) * 1e-3);
  if (check.underivable != 0)
    text +=
        fmt::format("              {} ages have too few events in the trace to be put together\n", check.underivable);
  if (check.unrecorded != 0)
    text += fmt::format("              {} traced ticks have no record in the run\n", check.unrecorded);
  for (const Disagreement& each : check.disagreements)
    text += fmt::format("              tick {}: {} is {} in the trace, {} in the records\n", each.tick, each.what,
                        each.traced, each.recorded);
  if (check.disagreement_count > check.disagreements.size())
    text += fmt::format("              and {} more\n", check.disagreement_count - check.disagreements.size());
  return text +
         (check.agrees() ? "              trace and records agree\n" : "              trace and records DISAGREE\n");
}

}  // namespace

std::string review_text(const TraceReview& review, const TraceReading& reading, const Timeline& timeline) {
  std::string text = fmt::format("trace         {} events, {:.3f} s; {}\n", reading.events,
                                 (timeline.last_at - timeline.first_at).seconds(), processes(timeline));
  if (reading.other_events != 0) text += fmt::format("              {} events of others\n", reading.other_events);
  for (const std::string& kind : reading.unreadable)
    text += fmt::format("              left out, of another version of Takt: {}\n", kind);
  text += losses(reading);
  text +=
      fmt::format("executive     {}: {} ticks every {:.3f} ms, {} late wake-ups, {} periods skipped\n",
                  review.executive_pid, review.ticks, ms(review.period), review.late_wakeups, review.skipped_periods);
  text += commands(review.chains) + stages(review) + worst(review);
  if (!review.records) return text + "\nrecords       not compared: name the run with --run RUN_FOLDER\n";
  return text + check_text(*review.records);
}

}  // namespace takt::lab
