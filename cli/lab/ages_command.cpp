// SPDX-License-Identifier: Apache-2.0
// takt ages: the freshness contract over a list of ages, from wherever they come.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <expected>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/lab_commands.hpp"
#include "cli/quantity_option.hpp"
#include "monitor/judge/freshness_statistics.hpp"

namespace takt::cli {
namespace {

constexpr std::size_t kMostAges = 10'000'000;
constexpr std::size_t kLongestWord = 40;  // of a number
constexpr double kNsPerMs = 1e6;

struct AgesOptions {
  std::string file;
  double max_age_ms = 0, period_ms = 0, epsilon = 0.01, confidence = 0.95;
  bool json = false;
};

bool separates(char letter) {
  return letter == ' ' || letter == '\t' || letter == ',' || letter == ';' || letter == '\r';
}

std::expected<std::int64_t, std::string> age_of(const std::string& word, std::size_t line) {
  double age_ms = 0;
  const char* const end = word.data() + word.size();
  const auto read = std::from_chars(word.data(), end, age_ms);
  const bool is_whole = read.ec == std::errc{} && read.ptr == end && word.size() <= kLongestWord;
  const bool is_age = is_whole && age_ms >= 0 && age_ms < 1e9;  // false for NaN, too
  if (is_age) return std::llround(age_ms * kNsPerMs);
  return std::unexpected(
      fmt::format("line {}: `{}` is no age; write milliseconds, one or more a line", line, word.substr(0, 20)));
}

// Nanoseconds. The error names the line. A line may have any length: no more of it than a word is held.
std::expected<std::vector<std::int64_t>, std::string> read_ages(std::istream& in) {
  std::vector<std::int64_t> ages;
  std::string word;
  std::size_t line = 1;
  for (bool ends = false; !ends;) {
    char letter = '\n';
    ends = !in.get(letter);
    const bool between = ends || letter == '\n' || separates(letter);
    if (!between) word += letter;
    if (!word.empty() && (between || word.size() > kLongestWord)) {
      const auto age = age_of(word, line);
      if (!age) return std::unexpected(age.error());
      if (ages.size() == kMostAges) return std::unexpected(fmt::format("holds more than {} ages", kMostAges));
      ages.push_back(*age);
      word.clear();
    }
    line += letter == '\n' ? 1 : 0;
  }
  if (ages.empty()) return std::unexpected("holds no age; write milliseconds, one or more a line");
  return ages;
}

std::string_view word(monitor::Verdict verdict) {
  switch (verdict) {
    case monitor::Verdict::held:
      return "held";
    case monitor::Verdict::undecided:
      return "undecided";
    case monitor::Verdict::violated:
      return "violated";
  }
  return "invalid";
}

int tell(const AgesOptions& options, std::vector<std::int64_t>& ages) {
  const auto max_age_ns = std::llround(options.max_age_ms * kNsPerMs);
  const auto misses = static_cast<std::uint64_t>(
      std::count_if(ages.begin(), ages.end(), [&](std::int64_t age) { return age > max_age_ns; }));
  const monitor::MissRate rate = monitor::miss_rate(misses, ages.size(), monitor::effective_count(ages, max_age_ns),
                                                    options.epsilon, options.confidence);
  const monitor::Quantiles ages_ns = monitor::quantiles_of(ages);
  const bool degraded = monitor::should_degrade(ages_ns, static_cast<double>(max_age_ns));
  if (options.json) {
    const nlohmann::ordered_json told{{"ages", ages_ns.count},
                                      {"control_period_ms", options.period_ms},
                                      {"policy_age_p50_ms", ages_ns.p50 / kNsPerMs},
                                      {"policy_age_p95_ms", ages_ns.p95 / kNsPerMs},
                                      {"policy_age_p99_ms", ages_ns.p99 / kNsPerMs},
                                      {"policy_age_max_ms", ages_ns.max / kNsPerMs},
                                      {"max_age_ms", options.max_age_ms},
                                      {"deadline_miss_rate", rate.rate},
                                      {"effective_ages", rate.effective_count},
                                      {"deadline_miss_rate_lower", rate.lower_bound},
                                      {"deadline_miss_rate_upper", rate.upper_bound},
                                      {"epsilon", options.epsilon},
                                      {"confidence", options.confidence},
                                      {"contract", word(rate.verdict)},
                                      {"degraded_mode", degraded}};
    fmt::print("{}\n", json_line(told));
    return kExitOk;
  }
  fmt::print("{} ages: p50 {:.1f} ms, p95 {:.1f} ms, p99 {:.1f} ms, longest {:.1f} ms{}\n", ages_ns.count,
             ages_ns.p50 / kNsPerMs, ages_ns.p95 / kNsPerMs, ages_ns.p99 / kNsPerMs, ages_ns.max / kNsPerMs,
             options.period_ms > 0 ? fmt::format("; control period {:g} ms", options.period_ms) : "");
  fmt::print("deadline miss rate {:.3g}: {} of {} older than {:g} ms; {:.3g} to {:.3g}, each at {:g} % confidence\n",
             rate.rate, misses, ages_ns.count, options.max_age_ms, rate.lower_bound, rate.upper_bound,
             100 * options.confidence);
  if (rate.effective_count < static_cast<double>(rate.count))
    fmt::print("each age depends on the one before: {} say as much as {:.0f} independent ones\n", rate.count,
               rate.effective_count);
  fmt::print("contract Pr(age > {:g} ms) <= {:g}: {}\n", options.max_age_ms, options.epsilon, word(rate.verdict));
  fmt::print("degraded: {}, p95 is {} {:g} ms\n", degraded ? "true" : "false", degraded ? "beyond" : "within",
             options.max_age_ms);
  return kExitOk;
}

int run(const AgesOptions& options) {
  std::ifstream file;
  if (options.file != "-") {
    file.open(options.file);
    if (!file) return fail("takt ages", fmt::format("{}: cannot be read", options.file));
  }
  auto ages = read_ages(options.file == "-" ? std::cin : file);
  if (!ages) return fail("takt ages", fmt::format("{}: {}", options.file, ages.error()));
  return tell(options, *ages);
}

}  // namespace

void add_ages(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "ages");
  auto options = std::make_shared<AgesOptions>();
  command->add_option("FILE", options->file, "ages in ms, one or more a line, also by commas; -: standard input")
      ->required();
  add_quantity(*command, "--max-age", options->max_age_ms, "ms", "oldest age that is fresh")
      ->required()
      ->check(CLI::PositiveNumber);
  add_quantity(*command, "--period", options->period_ms, "ms", "control period, told beside the ages")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--epsilon", options->epsilon, "share of ages that may be older")->check(CLI::Range(1e-9, 1.0));
  command->add_option("--confidence", options->confidence, "of either claim, held or violated")
      ->check(CLI::Range(0.5, 0.999999));
  command->add_flag("--json", options->json, "one line of JSON");
  command->footer(
      "Example: takt ages ages.txt --max-age 40ms --period 5ms\n"
      "Quantiles are Python's statistics.quantiles. Ages stand in the order they came: where each depends on the one "
      "before, bounds are those of fewer, independent ones.\n"
      "Exit codes: 0 told; 1 the list cannot be read; 64 command line.");
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace takt::cli
