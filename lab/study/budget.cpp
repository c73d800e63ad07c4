// SPDX-License-Identifier: Apache-2.0
#include "lab/study/budget.hpp"

#include <algorithm>
#include <array>

namespace takt::study {
namespace {

constexpr std::array<double, 10> kRates{5, 10, 15, 20, 30, 50, 100, 200, 500, 1000};
constexpr double kRounding_ms = 1e-9;  // 1000 / rate is not exact

Execution execution_of(double typical_ms, double worst_ms, double period_ms, const Budget& budget) {
  Execution made;
  made.typical_slack_ms = period_ms - typical_ms;
  made.worst_slack_ms = period_ms - worst_ms;
  made.fit = made.worst_slack_ms >= -kRounding_ms     ? Fit::fits
             : made.typical_slack_ms >= -kRounding_ms ? Fit::tail
                                                      : Fit::never;
  made.interval_ms = std::max(period_ms, worst_ms);
  made.oldest_ms = budget.total.worst_ms + made.interval_ms;
  made.is_fresh = !budget.max_age_ms || made.oldest_ms <= *budget.max_age_ms + kRounding_ms;
  return made;
}

RateBudget rate_budget(double rate_Hz, const Budget& budget) {
  RateBudget made{.rate_Hz = rate_Hz, .period_ms = 1000 / rate_Hz, .serial = {}, .pipelined = {}, .stage_slack_ms = {}};
  double typical_slowest_ms = 0;
  for (const StageTime& stage : budget.stages) {
    if (!stage.waits) typical_slowest_ms = std::max(typical_slowest_ms, stage.typical_ms);
    made.stage_slack_ms.push_back(made.period_ms - stage.worst_ms);
  }
  made.serial = execution_of(budget.total.typical_ms, budget.total.worst_ms, made.period_ms, budget);
  made.pipelined = execution_of(typical_slowest_ms, budget.stages[budget.slowest].worst_ms, made.period_ms, budget);
  return made;
}

StageTime sum_of(const std::vector<StageTime>& stages) {
  StageTime sum{.name = "sum", .typical_ms = 0, .worst_ms = 0, .source = "of the stages"};
  for (const StageTime& stage : stages) {
    sum.typical_ms += stage.typical_ms;
    sum.worst_ms += stage.worst_ms;
  }
  return sum;
}

nlohmann::ordered_json to_json(const Execution& execution) {
  return {{"fit", name(execution.fit)},
          {"typical_slack_ms", execution.typical_slack_ms},
          {"worst_slack_ms", execution.worst_slack_ms},
          {"interval_ms", execution.interval_ms},
          {"oldest_command_ms", execution.oldest_ms},
          {"within_max_age", execution.is_fresh}};
}

nlohmann::ordered_json to_json(const StageTime& stage) {
  return {{"name", stage.name},
          {"typical_ms", stage.typical_ms},
          {"worst_ms", stage.worst_ms},
          {"waits", stage.waits},
          {"source", stage.source}};
}

}  // namespace

std::vector<StageTime> figure_stages() {
  const std::string figure = "figure 55.2A";
  return {{"perception", 30, 30, figure},
          {"inference", 15, 15, figure},
          {"planning", 5, 5, figure},
          {"actuation", 1, 1, figure}};
}

std::span<const double> usual_rates_Hz() {
  return kRates;
}

std::string_view name(Fit fit) {
  switch (fit) {
    case Fit::fits:
      return "fits";
    case Fit::tail:
      return "tail";
    case Fit::never:
      return "no";
  }
  return "invalid";
}

Budget budget_of(Question question) {
  Budget made;
  made.total = question.measured_total.value_or(sum_of(question.stages));
  made.stages = std::move(question.stages);
  made.max_age_ms = question.max_age_ms;
  const auto busy_ms = [](const StageTime& stage) { return stage.waits ? -1 : stage.worst_ms; };
  const auto slowest = std::ranges::max_element(made.stages, {}, busy_ms);
  made.slowest = static_cast<std::size_t>(slowest - made.stages.begin());
  made.serial_Hz = 1000 / made.total.worst_ms;
  made.pipelined_Hz = 1000 / slowest->worst_ms;
  std::ranges::sort(question.rates_Hz);
  const auto [first, last] = std::ranges::unique(question.rates_Hz);
  question.rates_Hz.erase(first, last);
  for (const double rate : question.rates_Hz) made.rates.push_back(rate_budget(rate, made));
  return made;
}

nlohmann::ordered_json to_json(const Budget& budget) {
  nlohmann::ordered_json json{{"schema", "takt.budget/1"}, {"stages", nlohmann::ordered_json::array()}};
  for (const StageTime& stage : budget.stages) json["stages"].push_back(to_json(stage));
  json["total"] = to_json(budget.total);
  json["slowest_stage"] = budget.stages[budget.slowest].name;
  json["max_age_ms"] = budget.max_age_ms ? nlohmann::ordered_json(*budget.max_age_ms) : nlohmann::ordered_json();
  json["highest_serial_Hz"] = budget.serial_Hz;
  json["highest_pipelined_Hz"] = budget.pipelined_Hz;
  json["rates"] = nlohmann::ordered_json::array();
  for (const RateBudget& rate : budget.rates) {
    nlohmann::ordered_json slack;
    for (std::size_t i = 0; i < budget.stages.size(); ++i) slack[budget.stages[i].name] = rate.stage_slack_ms[i];
    json["rates"].push_back({{"rate_Hz", rate.rate_Hz},
                             {"period_ms", rate.period_ms},
                             {"serial", to_json(rate.serial)},
                             {"pipelined", to_json(rate.pipelined)},
                             {"stage_slack_ms", slack}});
  }
  return json;
}

}  // namespace takt::study
