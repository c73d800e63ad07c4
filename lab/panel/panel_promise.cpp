// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/panel_promise.hpp"

#include <cmath>
#include <span>

#include "config/document.hpp"
#include "config/units.hpp"
#include "lab/panel/panel_file.hpp"

namespace takt::lab {
namespace {

void take(std::span<const config::Override> overrides, PanelPromise::Contract& contract) {
  for (const config::Override& one : overrides) {
    const auto number = config::parse_number(one.value);
    if (one.key == "freshness.max_age") {
      if (const auto ns = config::parse_quantity(one.value, config::Dimension::time))
        contract.max_age_ms = Duration{std::llround(*ns)}.milliseconds();  // as manifests have it
    } else if (one.key == "freshness.epsilon" && number) {
      contract.epsilon = *number;
    } else if (one.key == "freshness.confidence" && number) {
      contract.confidence = *number;
    }
  }
}

PanelPromise::Configuration configuration_of(const PanelMethod& method) {
  PanelPromise::Configuration said;
  for (const config::Override& one : method.overrides) said[one.key] = one.value;
  if (method.repeat_last) said["link"] = "repeat_last";
  if (method.method.built_in != evidence::BuiltIn::takt || method.method.without) said["built in"] = method.name;
  return said;
}

}  // namespace

std::expected<PanelPromise, std::string> panel_promise(const std::string& path) {
  const auto text = config::read_file(path);
  if (!text) return std::unexpected(text.error());
  return panel_promise_of(*text, path);
}

std::expected<PanelPromise, std::string> panel_promise_of(const std::string& text, const std::string& name) {
  const auto panel = panel_of(text, name);
  if (!panel) return std::unexpected(panel.error().substr(0, panel.error().find('\n')));
  PanelPromise promise{.claims = panel->claims, .methods = {}, .conditions = {}, .outcomes = {}, .contracts = {}};
  for (const PanelMethod& method : panel->methods) promise.methods[method.name] = configuration_of(method);
  for (const PanelTask& task : panel->tasks) {
    const std::string task_name(evidence::kTaskNames[static_cast<std::size_t>(task.task)]);
    PanelPromise::Outcome& outcome = promise.outcomes[task_name];
    outcome.duration_s = panel->duration.seconds();
    if (task.task != evidence::Task::world) outcome.bound_m = task.bound_m;
    for (const PanelPerturbation& one : panel->perturbations)
      if (one.troubles(task.task)) promise.conditions.push_back({task_name, one.name(), one.dose});
    for (const PanelMethod& method : panel->methods) {
      PanelPromise::Contract& contract = promise.contracts[{method.name, task_name}];
      take(task.overrides, contract);
      take(method.overrides, contract);
      if (const auto own = evidence::own_max_age(method.method)) contract.max_age_ms = own->milliseconds();
    }
  }
  return promise;
}

}  // namespace takt::lab
