// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/confusion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace takt::lab {
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
    {"camera_freeze", Fault::sensor_backlog},
    {"sensor_lies", Fault::sensor_backlog},
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
    {"wrong_joint_order", Fault::controller_integration_error},
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

std::string share_text(std::uint64_t some, std::uint64_t all) {
  if (all == 0) return "0 of 0";
  return fmt::format("{} of {} ({:.1f} %)", some, all, 100 * static_cast<double>(some) / static_cast<double>(all));
}

std::string summary_text(const std::string& method, const Confusion& confusion) {
  std::string text = fmt::format("\nfault classifier on method {}: macro recall {:.3f}, macro precision {:.3f}\n",
                                 method, confusion.macro_recall().value_or(0), confusion.macro_precision().value_or(0));
  if (const auto troubled = confusion.macro_recall_of_troubled(); troubled && confusion.without_trouble() != 0)
    text += fmt::format("  macro recall {:.3f} without the rollouts that the planted cause did not trouble: {}\n",
                        *troubled, share_text(confusion.without_trouble(), confusion.planted_rollouts()));
  const std::uint64_t all = confusion.planted_rollouts();
  text += fmt::format("  cause left unnamed (unknown or none): {}\n", share_text(confusion.abstained(), all));
  if (confusion.has_shares)
    text += fmt::format("  another cause named besides: {}\n", share_text(confusion.named_besides, all));
  return text + fmt::format("  nominal rollouts with a verdict: {}\n",
                            share_text(confusion.nominal_labelled(), confusion.nominal_rollouts()));
}

std::string mixtures_text(const std::string& method, const Mixtures& mixtures) {
  std::string text = fmt::format("\nfault classifier on method {}: all planted causes named in {} mixtures\n", method,
                                 share_text(mixtures.all_named, mixtures.rollouts));
  text += fmt::format("  {:<30} {:>7} {:>7} {:>7} {:>9}\n", "cause", "planted", "named", "recall", "precision");
  for (const auto& [fault, cause] : mixtures.causes) {
    const auto precision = cause.precision();
    text += fmt::format("  {:<30} {:>7} {:>7} {:>7} {:>9}\n", name(fault), cause.planted, cause.named,
                        cause.planted == 0 ? "-" : fmt::format("{:.3f}", cause.recall()),
                        precision ? fmt::format("{:.3f}", *precision) : "-");
  }
  return text;
}

Json or_null(std::optional<double> number) {
  return number ? Json(*number) : Json();
}

Json mixtures_json(const Mixtures& mixtures) {
  Json causes = Json::object();
  for (const auto& [fault, cause] : mixtures.causes)
    causes[std::string(name(fault))] = {{"planted", cause.planted},
                                        {"named", cause.named},
                                        {"recall", cause.planted == 0 ? Json() : Json(cause.recall())},
                                        {"precision", or_null(cause.precision())}};
  return {{"rollouts", mixtures.rollouts}, {"all_named", mixtures.all_named}, {"causes", std::move(causes)}};
}

// Without what earlier rows do not say: their file stays as it was written.
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
  Json json{{"planted", std::move(planted)},
            {"macro_recall", or_null(confusion.macro_recall())},
            {"macro_precision", or_null(confusion.macro_precision())},
            {"abstained", confusion.abstained()},
            {"nominal", {{"rollouts", confusion.nominal_rollouts()}, {"labelled", confusion.nominal_labelled()}}}};
  if (!confusion.has_shares) return json;
  json["without_trouble"] = confusion.without_trouble();
  json["macro_recall_of_troubled"] = or_null(confusion.macro_recall_of_troubled());
  json["named_besides"] = confusion.named_besides;
  if (confusion.mixtures.rollouts != 0) json["mixtures"] = mixtures_json(confusion.mixtures);
  return json;
}

}  // namespace

std::string_view verdict_name(std::size_t index) {
  return index == kNoVerdict ? std::string_view("none") : monitor::kFaultNames[index];
}

std::set<Fault> planted_faults(std::string_view perturbation) {
  constexpr std::string_view kWith = "-with-";
  std::set<Fault> faults;
  while (!perturbation.empty()) {
    const std::size_t next = perturbation.find(kWith);
    const std::string_view one = perturbation.substr(0, next);
    const auto* const found = std::ranges::find(kPlanted, one.substr(0, one.find('-')), &Planted::perturbation);
    if (found != std::end(kPlanted)) faults.insert(found->fault);
    perturbation = next == std::string_view::npos ? std::string_view() : perturbation.substr(next + kWith.size());
  }
  return faults;
}

std::set<Fault> named_faults(const evidence::RolloutRow& row) {
  std::set<Fault> named;
  for (std::size_t index = 0; index < monitor::kFaultCount; ++index) {
    const bool is_telling = row.fault_shares[index] ? *row.fault_shares[index] >= monitor::kTellingShare
                                                    : row.leading_fault == monitor::kFaultNames[index];
    if (is_telling) named.insert(static_cast<Fault>(index));
  }
  named.erase(Fault::unknown);
  return named;
}

double Mixtures::Cause::recall() const {
  return planted == 0 ? 0 : static_cast<double>(right) / static_cast<double>(planted);
}

std::optional<double> Mixtures::Cause::precision() const {
  if (named == 0) return std::nullopt;
  return static_cast<double>(right) / static_cast<double>(named);
}

void Mixtures::add(const evidence::RolloutRow& row) {
  const std::set<Fault> planted = planted_faults(row.perturbation), named = named_faults(row);
  ++rollouts;
  for (const Fault fault : planted) ++causes[fault].planted;
  for (const Fault fault : named) {
    ++causes[fault].named;
    causes[fault].right += planted.contains(fault) ? 1U : 0U;
  }
  all_named += std::ranges::includes(named, planted) ? 1U : 0U;
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

std::optional<double> Confusion::recall_of_troubled(Fault fault) const {
  const auto found = planted.find(fault);
  const std::uint64_t troubled = found == planted.end() ? 0 : total(found->second) - found->second[kNoVerdict];
  if (troubled == 0) return std::nullopt;
  return static_cast<double>(found->second[static_cast<std::size_t>(fault)]) / static_cast<double>(troubled);
}

std::optional<double> Confusion::macro_recall_of_troubled() const {
  double sum = 0, troubled = 0;
  for (const auto& [fault, counts] : planted) {
    const auto recall = recall_of_troubled(fault);
    sum += recall.value_or(0);
    troubled += recall ? 1U : 0U;
  }
  return troubled == 0 ? std::nullopt : std::optional(sum / troubled);
}

std::uint64_t Confusion::planted_rollouts() const {
  std::uint64_t rollouts = 0;
  for (const auto& [fault, counts] : planted) rollouts += total(counts);
  return rollouts;
}

std::uint64_t Confusion::without_trouble() const {
  std::uint64_t rollouts = 0;
  for (const auto& [fault, counts] : planted) rollouts += counts[kNoVerdict];
  return rollouts;
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

std::map<std::string, Confusion> confusions_of(std::span<const evidence::RolloutRow> rows) {
  std::map<std::string, Confusion> by_method;
  for (const evidence::RolloutRow& row : rows) {
    Confusion& confusion = by_method[row.method];
    const std::size_t verdict = row.leading_fault.empty() ? kNoVerdict : verdict_index(row.leading_fault);
    confusion.has_shares = confusion.has_shares || row.fault_shares.front();
    const std::set<Fault> planted = planted_faults(row.perturbation);
    if (row.perturbation == "none") {
      ++confusion.nominal[verdict];
    } else if (planted.size() == 1) {
      ++confusion.planted[*planted.begin()][verdict];
      confusion.named_besides += named_faults(row).size() > 1 ? 1U : 0U;
    } else if (planted.size() > 1) {
      confusion.mixtures.add(row);
    }
  }
  return by_method;
}

std::string confusion_text(const std::map<std::string, Confusion>& confusions) {
  std::string text;
  for (const auto& [method, confusion] : confusions) {
    if (!confusion.planted.empty()) text += summary_text(method, confusion) + matrix_text(confusion);
    if (confusion.mixtures.rollouts != 0) text += mixtures_text(method, confusion.mixtures);
  }
  return text;
}

Json confusion_json(const std::map<std::string, Confusion>& confusions, const std::string& artifact_id) {
  Json methods = Json::object();
  for (const auto& [method, confusion] : confusions) methods[method] = method_json(confusion);
  return {{"schema", kConfusionSchema}, {"artifact_id", artifact_id}, {"methods", std::move(methods)}};
}

}  // namespace takt::lab
