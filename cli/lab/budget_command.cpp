// SPDX-License-Identifier: Apache-2.0
// takt budget: which loop rates fit the stages of a loop, and how old the commands then are.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/lab_commands.hpp"
#include "cli/run/checked_robot.hpp"
#include "cli/run/scenario.hpp"
#include "config/load.hpp"
#include "config/units.hpp"
#include "lab/study/budget_sources.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::cli {
namespace {

struct BudgetOptions {
  std::string source, max_age, require, svg;
  std::vector<std::string> stages, rates;
  bool serial = false, json = false;
};

// What is asked, and the rate whose periods are drawn.
struct Asked {
  study::Question question;
  double focus_Hz = 50;
};

using Refused = std::unexpected<Refusal>;

Refused usage(const std::string& sentence) {
  return Refused({kExitUsage, "takt budget: " + sentence});
}

// "50Hz", "50 Hz".
std::expected<double, Refusal> parse_rate(std::string_view text) {
  const std::size_t digits = std::min(text.find_first_not_of("0123456789."), text.size());
  const std::size_t unit = std::min(text.find_first_not_of(' ', digits), text.size());
  const auto rate = config::parse_quantity(fmt::format("{} {}", text.substr(0, digits), text.substr(unit)),
                                           config::Dimension::frequency);
  if (!rate || *rate <= 0) return usage(fmt::format("`{}` is not a rate; write a number and Hz, such as 50Hz", text));
  return *rate;
}

std::expected<double, Refusal> parse_ms(std::string_view text) {
  const auto duration = parse_duration(text);
  if (!duration) return usage(duration.error());
  return duration->milliseconds();
}

// "inference=15ms", "inference=15ms/40ms": typical and worst.
std::expected<study::StageTime, Refusal> parse_stage(std::string_view text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos || equals == 0)
    return usage(fmt::format("--stage {}: write NAME=TIME or NAME=TYPICAL/WORST, such as inference=15ms/40ms", text));
  const std::string_view times = text.substr(equals + 1);
  const std::size_t slash = std::min(times.find('/'), times.size());
  const auto typical = parse_ms(times.substr(0, slash));
  if (!typical) return Refused(typical.error());
  const auto worst = slash == times.size() ? typical : parse_ms(times.substr(slash + 1));
  if (!worst) return Refused(worst.error());
  if (*worst < *typical)
    return usage(fmt::format("--stage {}: the worst case comes second and is the longer one", text));
  return study::StageTime{std::string(text.substr(0, equals)), *typical, *worst, "command line"};
}

std::expected<Asked, Refusal> ask_source(const std::string& source) {
  if (source.empty()) {
    const auto usual = study::usual_rates_Hz();
    return Asked{{study::figure_stages(), {}, {usual.begin(), usual.end()}, {}}, 50};
  }
  if (std::filesystem::is_directory(source)) {
    const auto run = monitor::open_run(source);
    if (!run) return Refused({kExitFailed, "takt budget: " + run.error()});
    const auto metrics = monitor::metrics_of(*run);
    if (!metrics) return Refused({kExitFailed, "takt budget: " + metrics.error()});
    auto question = study::question_of(*run, *metrics);
    if (!question) return Refused({kExitFailed, "takt budget: " + question.error()});
    return Asked{std::move(*question), study::focus_Hz_of(run->robot)};
  }
  const auto checked = check_robot_file(source);
  if (!checked) return Refused({config::kExitBadConfiguration, checked.error()});
  return Asked{study::question_of(checked->robot, checked->loads), study::focus_Hz_of(checked->robot)};
}

// A stage of the command line replaces the one of its name, or comes last.
std::expected<void, Refusal> add_stages(const BudgetOptions& options, study::Question& question) {
  for (const std::string& text : options.stages) {
    auto stage = parse_stage(text);
    if (!stage) return Refused(stage.error());
    const auto same = std::ranges::find(question.stages, stage->name, &study::StageTime::name);
    if (same != question.stages.end())
      *same = std::move(*stage);
    else
      question.stages.push_back(std::move(*stage));
    question.measured_total.reset();
  }
  const bool works = std::ranges::any_of(
      question.stages, [](const study::StageTime& stage) { return !stage.waits && stage.worst_ms > 0; });
  if (!works) return usage("no stage takes any time; give one with --stage NAME=TIME");
  return {};
}

std::expected<void, Refusal> add_rates(const BudgetOptions& options, Asked& asked) {
  if (!options.rates.empty()) asked.question.rates_Hz.clear();
  for (const std::string& text : options.rates) {
    const auto rate = parse_rate(text);
    if (!rate) return Refused(rate.error());
    asked.question.rates_Hz.push_back(*rate);
  }
  if (!options.rates.empty()) asked.focus_Hz = asked.question.rates_Hz.front();
  if (options.require.empty()) return {};
  const auto required = parse_rate(options.require);
  if (!required) return Refused(required.error());
  asked.question.rates_Hz.push_back(asked.focus_Hz = *required);
  return {};
}

std::expected<Asked, Refusal> ask(const BudgetOptions& options) {
  auto asked = ask_source(options.source);
  if (!asked) return asked;
  if (auto added = add_stages(options, asked->question); !added) return Refused(added.error());
  if (auto added = add_rates(options, *asked); !added) return Refused(added.error());
  if (options.max_age.empty()) return asked;
  const auto max_age = parse_ms(options.max_age);
  if (!max_age) return Refused(max_age.error());
  asked->question.max_age_ms = *max_age;
  return asked;
}

int judge(const BudgetOptions& options, const study::Budget& result, double focus_Hz) {
  if (options.require.empty()) return kExitOk;
  const auto rate = std::ranges::find(result.rates, focus_Hz, &study::RateBudget::rate_Hz);
  const study::Execution& how = options.serial ? rate->serial : rate->pipelined;
  return how.fit == study::Fit::fits && how.is_fresh ? kExitOk : kExitFailed;
}

int run(const BudgetOptions& options) {
  auto asked = ask(options);
  if (!asked) {
    fmt::print(stderr, "{}\n", asked.error().sentence);
    return asked.error().exit_code;
  }
  const study::Budget result = study::budget_of(std::move(asked->question));
  if (!options.svg.empty()) {
    if (auto written = monitor::replace_file(options.svg, study::budget_svg(result, asked->focus_Hz)); !written) {
      fmt::print(stderr, "takt budget: {}\n", written.error());
      return kExitFailed;
    }
  }
  fmt::print("{}",
             options.json ? json_line(study::to_json(result)) + "\n" : study::budget_text(result, asked->focus_Hz));
  return judge(options, result, asked->focus_Hz);
}

}  // namespace

void add_budget(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "budget");
  auto options = std::make_shared<BudgetOptions>();
  command->add_option("SOURCE", options->source,
                      "robot file or run folder; default: 30, 15, 5 and 1 ms of perception, inference, planning, "
                      "actuation");
  command->add_option("--stage", options->stages, "NAME=TIME or NAME=TYPICAL/WORST, replacing or adding a stage");
  command->add_option("--rate", options->rates,
                      "a loop rate, such as 50Hz, instead of the usual ones; may be repeated");
  command->add_option("--max-age", options->max_age, "limit on a command's age; default: the robot file's");
  command->add_option("--require", options->require, "end with 1 unless this rate fits, within max_age");
  command->add_flag("--serial", options->serial, "judge --require by serial instead of pipelined execution");
  command->add_option("--svg", options->svg, "also write the budget as a picture");
  command->add_flag("--json", options->json, "print the budget as one line of JSON (docs/budget.md)");
  command->footer(
      "Example: takt budget config/arm6.yaml --stage inference=15ms/40ms --require 15Hz\n"
      "Exit codes: 0 drawn; 1 the required rate does not fit, or the run cannot be read; 64 command line; 65 robot "
      "file.");
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace takt::cli
