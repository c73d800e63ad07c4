// SPDX-License-Identifier: Apache-2.0
// takt trace review: where the time went in a trace, and whether it agrees with the run's records.
#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <expected>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/lab_commands.hpp"
#include "lab/trace/otlp_check.hpp"
#include "lab/trace/perfetto.hpp"
#include "lab/trace/review.hpp"
#include "lab/trace/run_records.hpp"

namespace takt::cli {
namespace {

struct TraceReviewOptions {
  std::string directory, run, perfetto;
  bool json = false;
};

// Empty when written.
std::string export_perfetto(const std::string& path, const lab::Timeline& timeline, const lab::TraceReview& review) {
  std::ofstream file(path, std::ios::binary);
  lab::write_perfetto(timeline, review.chains, review.executive_pid, [&file](std::string_view text) { file << text; });
  file.close();
  return file.good() ? "" : fmt::format("{} cannot be written: {}", path, std::strerror(errno));
}

using Records = std::optional<std::vector<lab::TickFacts>>;

// What the run told OpenTelemetry, where it did.
std::expected<std::optional<lab::OtlpCheck>, std::string> otlp_of(const std::string& run, const Records& records) {
  const std::string path = run + "/otlp_traces.jsonl";
  if (!records || !std::filesystem::exists(path)) return std::nullopt;
  std::ifstream file(path);
  const auto told = lab::read_told_commands(file);
  if (!told) return std::unexpected(path + ": " + told.error());
  return lab::check_told_commands(*told, *records);
}

int review(const TraceReviewOptions& options) {
  Records records;
  if (!options.run.empty()) {
    auto read = lab::records_of(options.run);
    if (!read) return fail("takt trace review", read.error());
    records = std::move(*read);
  }
  lab::Timeline timeline;
  const auto reading =
      lab::read_trace(options.directory, [&timeline](const lab::TraceEvent& event) { timeline.add(event); });
  if (!reading) return fail("takt trace review", reading.error());
  const auto review = lab::review_trace(timeline, records ? &*records : nullptr);
  if (!review) return fail("takt trace review", review.error());
  if (!options.perfetto.empty()) {
    const std::string error = export_perfetto(options.perfetto, timeline, *review);
    if (!error.empty()) return fail("takt trace review", error);
  }
  const auto otlp = otlp_of(options.run, records);
  if (!otlp) return fail("takt trace review", otlp.error());
  if (options.json)
    fmt::print("{}\n", json_line(lab::to_json(*review, *reading, timeline)));
  else
    fmt::print("{}{}", lab::review_text(*review, *reading, timeline), *otlp ? otlp_text(**otlp) : "");
  if (*otlp && !(*otlp)->agrees())
    return fail("takt trace review",
                fmt::format("OpenTelemetry was told otherwise than was recorded: {} commands compared, {} differences",
                            (*otlp)->commands, (*otlp)->disagreement_count));
  if (!review->records || review->records->agrees()) return kExitOk;
  return fail("takt trace review", fmt::format("trace and records disagree: {} ticks compared, {} differences",
                                               review->records->ticks, review->records->disagreement_count));
}

}  // namespace

void add_trace_review(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "review");
  auto options = std::make_shared<TraceReviewOptions>();
  command->add_option("DIR", options->directory, "what takt trace start or a snapshot wrote")->required();
  command->add_option("--run", options->run, "run folder of the same time, to compare every age with");
  command->add_flag("--json", options->json, "one line of JSON (docs/tracing.md)");
  command->add_option("--perfetto", options->perfetto, "file to write for ui.perfetto.dev (Trace Event JSON)");
  command->footer(
      "Example: takt trace review /var/tmp/t1 --run runs/20261121T093300Z-arm6-3f9a2c\n"
      "Exit codes: 0 reviewed, and every age agrees with the records within 20 us when --run is given (those "
      "told to\n"
      "OpenTelemetry too, where the run has them); 1 one does not, or trace or run cannot be read.");
  command->callback([options, &exit_code] { exit_code = review(*options); });
}

}  // namespace takt::cli
