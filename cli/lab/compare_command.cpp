// SPDX-License-Identifier: Apache-2.0
// takt compare: two methods row by row, only where the same-artifact rule allows it.
#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string_view>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/lab/margin_option.hpp"
#include "cli/lab_commands.hpp"
#include "lab/judge/compare.hpp"
#include "lab/panel/panel_promise.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::cli {
namespace {

struct CompareOptions {
  std::string a, b, method_a, method_b, html, margin;
  bool json = false, rows = false, plan = false;
};

int compare(const CompareOptions& options) {
  std::optional<lab::SuccessMargin> margin;
  if (!options.margin.empty()) {
    const auto width = margin_of(options.margin);
    if (!width)
      return refuse(kExitUsage, fmt::format("takt compare: --margin {}: write a share of success between 0 and 100 %, "
                                            "such as 2%",
                                            options.margin));
    margin = {.width = *width, .with_plan = options.plan};
  }
  const auto a = lab::open_finished_artifact(options.a);
  if (!a) return fail("takt compare", a.error());
  const auto b = lab::open_finished_artifact(options.b.empty() ? options.a : options.b);
  if (!b) return fail("takt compare", b.error());
  auto comparison = lab::compare(*a, *b, options.method_a, options.method_b);
  if (!comparison) return fail("takt compare", comparison.error());
  comparison->margin = margin;
  if (const auto promise = lab::panel_promise(a->folder.panel()))
    lab::name_configuration(*a, *b, *promise, *comparison);
  else
    comparison->notes.push_back(promise.error());
  if (!options.html.empty()) {
    auto written = monitor::replace_file(options.html, lab::comparison_html(*comparison));
    if (!written) return fail("takt compare", written.error());
  }
  if (options.json) {
    fmt::print("{}\n", json_line(lab::to_json(*comparison)));
  } else {
    fmt::print("{}", options.rows ? lab::comparison_rows_text(*comparison) : lab::comparison_text(*comparison));
  }
  return kExitOk;
}

}  // namespace

void add_compare(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "compare");
  auto options = std::make_shared<CompareOptions>();
  command->add_option("A", options->a, "artifact folder")->required();
  command->add_option("B", options->b, "artifact folder; default: A, to compare two of its methods");
  command->add_option("--method-a", options->method_a, "method of A; needed where A holds several");
  command->add_option("--method-b", options->method_b, "method of B; needed where B holds several");
  command->add_flag("--json", options->json, "print the comparison as one line of JSON (docs/evidence.md)");
  auto* const rows = command->add_flag("--rows", options->rows, "list the pairs row by row instead of the statistics");
  auto* const margin = command->add_option("--margin", options->margin,
                                           "P%: say whether B's success is worse than A's by no more than this");
  margin->excludes(rows);
  command->add_flag("--plan", options->plan, "with --margin: also say how many pairs decide")->needs(margin);
  command->add_option("--html", options->html, "also write the comparison as one HTML file");
  command->footer(
      "Example: takt compare artifacts/smoke --method-a fast --method-b slow --margin 2%\n"
      "Exit codes: 0 compared; 1 not comparable, with the reason, or not an artifact; 64 command line.");
  command->callback([options, &exit_code] { exit_code = compare(*options); });
}

}  // namespace takt::cli
