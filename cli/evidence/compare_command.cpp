// takt compare: two methods row by row, only where the same-artifact rule allows it.
#include <fmt/format.h>

#include <memory>

#include "cli/command.hpp"
#include "evidence/judge/compare.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::cli {
namespace {

struct CompareOptions {
  std::string a, b, method_a, method_b, html;
  bool json = false, rows = false;
};

int compare(const CompareOptions& options) {
  const auto a = panel::open_finished_artifact(options.a);
  if (!a) return fail("takt compare", a.error());
  const auto b = panel::open_finished_artifact(options.b.empty() ? options.a : options.b);
  if (!b) return fail("takt compare", b.error());
  const auto comparison = panel::compare(*a, *b, options.method_a, options.method_b);
  if (!comparison) return fail("takt compare", comparison.error());
  if (!options.html.empty()) {
    auto written = monitor::replace_file(options.html, panel::comparison_html(*comparison));
    if (!written) return fail("takt compare", written.error());
  }
  if (options.json) {
    fmt::print("{}\n", panel::to_json(*comparison).dump());
  } else {
    fmt::print("{}", options.rows ? panel::comparison_rows_text(*comparison) : panel::comparison_text(*comparison));
  }
  return kExitOk;
}

}  // namespace

void add_compare(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("compare", "Compare two methods row by row, if they are comparable.");
  auto options = std::make_shared<CompareOptions>();
  command->add_option("A", options->a, "artifact folder")->required();
  command->add_option("B", options->b, "artifact folder; default: A, to compare two of its methods");
  command->add_option("--method-a", options->method_a, "method of A; needed where A holds several");
  command->add_option("--method-b", options->method_b, "method of B; needed where B holds several");
  command->add_flag("--json", options->json, "print the comparison as one line of JSON (docs/evidence.md)");
  command->add_flag("--rows", options->rows, "list the pairs row by row instead of the statistics");
  command->add_option("--html", options->html, "also write the comparison as one HTML file");
  command->footer(
      "Example: takt compare artifacts/smoke --method-a fast --method-b slow\n"
      "Exit codes: 0 compared; 1 not comparable, with the reason, or not an artifact.");
  command->callback([options, &exit_code] { exit_code = compare(*options); });
}

}  // namespace takt::cli
