// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/confusion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace takt::panel {
namespace {

using Json = nlohmann::ordered_json;
using monitor::Fault;

struct Planted {
  std::string_view perturbation;
  Fault fault;
};
constexpr Planted kPlanted[] = {
    {"sensor_burst", Fault::sensor_backlog},
    {"sensor_dropout", Fault::sensor_backlog},
    {"estimator_delay", Fault::estimator_lag},
    {"inference_stall", Fault::inference_stall},
    {"inference_mean_shift", Fault::inference_stall},
    {"gpu_contention", Fault::inference_stall},
    {"policy_crash", Fault::inference_stall},
    {"policy_freeze", Fault::inference_stall},
    {"queue_growth", Fault::middleware_queue_growth},
    {"publish_delay", Fault::middleware_queue_growth},
    {"scheduler_preemption", Fault::scheduler_preemption},
    {"cpu_hog", Fault::scheduler_preemption},
    {"rt_throttling", Fault::scheduler_preemption},
    {"bad_actions_nan", Fault::controller_integration_error},
    {"bad_actions_range", Fault::controller_integration_error},
    {"can_loss", Fault::actuator_or_bus_fault},
    {"bus_off", Fault::actuator_or_bus_fault},
};

std::size_t verdict_index(std::string_view name) {
  return static_cast<std::size_t>(std::ranges::find(monitor::kFaultNames, name) - monitor::kFaultNames.begin());
}

std::uint64_t total(const VerdictCounts& counts) {
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

std::string matrix_text(const Confusion& confusion) {
  std::string text = fmt::format("  {:<30}", "planted \\ verdict");
  for (std::size_t index = 0; index <= kNoVerdict; ++index) text += fmt::format(" {:>9.9}", verdict_name(index));
  text += fmt::format(" {:>7}\n", "recall");
  for (const auto& [fault, counts] : confusion.planted) {
    text += fmt::format("  {:<30}", name(fault));
    for (const std::uint64_t count : counts) text += fmt::format(" {:>9}", count);
    text += fmt::format(" {:>7.3f}\n", confusion.recall(fault));
  }
  text += fmt::format("  {:<30}", "precision");
  for (std::size_t index = 0; index < monitor::kFaultCount; ++index) {
    const auto precision = confusion.precision(static_cast<Fault>(index));
    text += fmt::format(" {:>9}", precision ? fmt::format("{:.3f}", *precision) : "-");
  }
  text += '\n';
  return text;
}

Json or_null(std::optional<double> number) {
  return number ? Json(*number) : Json();
}

Json method_json(const Confusion& confusion) {
  Json planted = Json::object();
  for (const auto& [fault, counts] : confusion.planted) {
    Json verdicts = Json::object();
    for (std::size_t index = 0; index <= kNoVerdict; ++index)
      verdicts[std::string(verdict_name(index))] = counts[index];
    planted[std::string(name(fault))] = {{"recall", confusion.recall(fault)},
                                         {"precision", or_null(confusion.precision(fault))},
                                         {"verdicts", std::move(verdicts)}};
  }
  return {{"planted", std::move(planted)},
          {"macro_recall", or_null(confusion.macro_recall())},
          {"macro_precision", or_null(confusion.macro_precision())},
          {"abstained", confusion.abstained()},
          {"nominal", {{"rollouts", confusion.nominal_rollouts()}, {"labelled", confusion.nominal_labelled()}}}};
}

}  // namespace

std::string_view verdict_name(std::size_t index) {
  return index == kNoVerdict ? std::string_view("none") : monitor::kFaultNames[index];
}

std::optional<Fault> planted_fault(std::string_view perturbation) {
  const auto* const found = std::ranges::find(kPlanted, perturbation, &Planted::perturbation);
  if (found == std::end(kPlanted)) return std::nullopt;
  return found->fault;
}

std::string_view leading_fault(const monitor::FaultSummary& summary) {
  const auto worst = std::ranges::max_element(summary.costs);
  return worst->stretches == 0 ? std::string_view()
                               : monitor::kFaultNames[static_cast<std::size_t>(worst - summary.costs.begin())];
}

double Confusion::recall(Fault fault) const {
  const auto found = planted.find(fault);
  if (found == planted.end()) return 0;
  return static_cast<double>(found->second[static_cast<std::size_t>(fault)]) /
         static_cast<double>(total(found->second));
}

std::optional<double> Confusion::precision(Fault fault) const {
  const auto index = static_cast<std::size_t>(fault);
  std::uint64_t said = nominal[index], right = 0;
  for (const auto& [cause, counts] : planted) {
    said += counts[index];
    if (cause == fault) right = counts[index];
  }
  if (said == 0) return std::nullopt;
  return static_cast<double>(right) / static_cast<double>(said);
}

std::optional<double> Confusion::macro_precision() const {
  if (planted.empty()) return std::nullopt;
  double sum = 0;
  for (const auto& [fault, counts] : planted) sum += precision(fault).value_or(0);
  return sum / static_cast<double>(planted.size());
}

std::uint64_t Confusion::abstained() const {
  std::uint64_t rollouts = 0;
  for (const auto& [fault, counts] : planted)
    rollouts += counts[kNoVerdict] + counts[static_cast<std::size_t>(Fault::unknown)];
  return rollouts;
}

std::uint64_t Confusion::nominal_rollouts() const {
  return total(nominal);
}

std::uint64_t Confusion::nominal_labelled() const {
  return total(nominal) - nominal[kNoVerdict];
}

std::optional<double> Confusion::macro_recall() const {
  if (planted.empty()) return std::nullopt;
  double sum = 0;
  for (const auto& [fault, counts] : planted) sum += recall(fault);
  return sum / static_cast<double>(planted.size());
}

std::map<std::string, Confusion> confusions_of(std::span<const RolloutRow> rows) {
  std::map<std::string, Confusion> by_method;
  for (const RolloutRow& row : rows) {
    Confusion& confusion = by_method[row.method];
    const std::size_t verdict = row.leading_fault.empty() ? kNoVerdict : verdict_index(row.leading_fault);
    if (row.perturbation == "none") {
      ++confusion.nominal[verdict];
    } else if (const auto fault = planted_fault(row.perturbation)) {
      ++confusion.planted[*fault][verdict];
    }
  }
  return by_method;
}

std::string confusion_text(const std::map<std::string, Confusion>& confusions) {
  std::string text;
  for (const auto& [method, confusion] : confusions) {
    const auto macro = confusion.macro_recall();
    if (!macro) continue;
    text += fmt::format(
        "\nfault classifier on method {}: macro recall {:.3f}, macro precision {:.3f}, nominal rollouts with a verdict "
        "{} "
        "of {}\n",
        method, *macro, confusion.macro_precision().value_or(0), confusion.nominal_labelled(),
        confusion.nominal_rollouts());
    text += matrix_text(confusion);
  }
  return text;
}

Json confusion_json(const std::map<std::string, Confusion>& confusions, const std::string& artifact_id) {
  Json methods = Json::object();
  for (const auto& [method, confusion] : confusions) methods[method] = method_json(confusion);
  return {{"schema", kConfusionSchema}, {"artifact_id", artifact_id}, {"methods", std::move(methods)}};
}

}  // namespace takt::panel
