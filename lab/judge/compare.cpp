// SPDX-License-Identifier: Apache-2.0
#include "lab/judge/compare.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <string_view>

#include "lab/artifact/rollout_fields.hpp"
#include "lab/judge/exact_rate_interval.hpp"

namespace takt::lab {
namespace {

// The numbers a comparison shows, by their names in the row. Success, as 0 or 1, has its own table too.
constexpr std::array<std::string_view, 21> kComparedMetrics{"success",
                                                            "rearms",
                                                            "age_per_command.total.p50_ms",
                                                            "age_per_command.total.p95_ms",
                                                            "age_per_command.total.p99_ms",
                                                            "age_per_tick.total.p95_ms",
                                                            "misses_per_command.rate",
                                                            "misses_per_tick.rate",
                                                            "tracking_error_rms_m",
                                                            "tracking_error_p95_m",
                                                            "constraint_violations",
                                                            "recovery_s",
                                                            "safety.entered_degraded",
                                                            "safety.entered_damped_stop",
                                                            "safety.entered_fault_latched",
                                                            "safety.envelope_violations",
                                                            "interventions.envelope_clamp",
                                                            "mode_share.tracking",
                                                            "energy_J",
                                                            "peak_torque_Nm",
                                                            "torque_rate_Nm_s"};

std::optional<double> number_at(const RolloutField& field, const evidence::RolloutRow& row) {
  const FieldPlace place = place_in(field, row);
  if (auto* const* yes = std::get_if<bool*>(&place)) return **yes ? 1 : 0;
  if (auto* const* number = std::get_if<double*>(&place)) return **number;
  if (auto* const* count = std::get_if<std::uint64_t*>(&place)) return static_cast<double>(**count);
  if (auto* const* optional = std::get_if<std::optional<double>*>(&place)) return **optional;
  return {};
}

std::vector<const RolloutField*> compared_fields(bool same_contract) {
  std::vector<const RolloutField*> fields;
  for (const std::string_view metric : kComparedMetrics) {
    if (!same_contract && metric.starts_with("misses_")) continue;
    const auto field = std::ranges::find(rollout_fields(), metric, &RolloutField::name);
    if (field != rollout_fields().end()) fields.push_back(&*field);
  }
  return fields;
}

bool more_is_better(std::string_view metric) {
  return metric == "success" || metric == "mode_share.tracking";
}

MetricDifference metric_difference(const RolloutField& field, std::span<const RowPair* const> pairs,
                                   const std::string& table) {
  MetricDifference result{.metric = field.name, .unit = field.unit, .difference = {}};
  std::map<std::uint64_t, SeedDifference> by_seed;
  double sum_a = 0, sum_b = 0, better = 0, count = 0;
  for (const RowPair* pair : pairs) {
    const auto a = number_at(field, pair->a), b = number_at(field, pair->b);
    if (!a || !b) {
      ++result.left_out;
      continue;
    }
    sum_a += *a;
    sum_b += *b;
    better += *a == *b ? 0.5 : (*b > *a) == more_is_better(field.name) ? 1 : 0;
    ++count;
    result.differs = result.differs || *a != *b;
    SeedDifference& seed = by_seed[pair->a.seed];
    seed.sum += *b - *a;
    ++seed.pairs;
  }
  if (count == 0) return result;
  result.mean_a = sum_a / count;
  result.mean_b = sum_b / count;
  result.b_better = better / count;
  std::vector<SeedDifference> seeds;
  for (const auto& [seed, difference] : by_seed) seeds.push_back(difference);
  result.difference = mean_difference(seeds, table + field.name);
  result.p_value = sign_flip_p(seeds);
  return result;
}

// The pairs' success, with the interval of its difference.
Interval judge_success(std::span<const RowPair* const> pairs, SuccessTable& table) {
  std::map<std::uint64_t, SeedSuccess> by_seed;
  for (const RowPair* pair : pairs) {
    std::uint64_t& cell = pair->a.success ? (pair->b.success ? table.both : table.only_a)
                                          : (pair->b.success ? table.only_b : table.neither);
    ++cell;
    SeedSuccess& seed = by_seed[pair->a.seed];
    seed.only_a += pair->a.success && !pair->b.success ? 1U : 0U;
    seed.only_b += pair->b.success && !pair->a.success ? 1U : 0U;
    ++seed.pairs;
  }
  std::vector<SeedSuccess> seeds;
  std::vector<SeedDifference> differences;
  for (const auto& [number, seed] : by_seed) {
    seeds.push_back(seed);
    differences.push_back({static_cast<double>(seed.only_b) - static_cast<double>(seed.only_a), seed.pairs});
    table.seeds_for_a += seed.only_a > seed.only_b ? 1U : 0U;
    table.seeds_for_b += seed.only_b > seed.only_a ? 1U : 0U;
  }
  table.seeds = seeds.size();
  table.p_value = sign_flip_p(differences);
  table.evidence = anytime_evidence(table.seeds_for_a, table.seeds_for_b);
  table.effective_pairs = effective_pairs(seeds);
  return exact_rate_interval(seeds);
}

void mark_clear_lines(std::vector<MetricDifference>& metrics) {
  std::vector<MetricDifference*> tested;
  std::vector<double> p_values;
  for (MetricDifference& metric : metrics) {
    if (!metric.differs) continue;
    tested.push_back(&metric);
    p_values.push_back(metric.p_value);
  }
  const std::vector<bool> rejected = holm_rejects(p_values);
  for (std::size_t at = 0; at < tested.size(); ++at) tested[at]->is_clear = rejected[at];
}

// `name` starts the generators of the table's lines.
GroupComparison group_of(std::span<const RowPair* const> pairs, std::span<const RolloutField* const> fields,
                         const std::string& name) {
  GroupComparison group;
  const Interval success = judge_success(pairs, group.success);
  for (const RolloutField* field : fields) {
    group.metrics.push_back(metric_difference(*field, pairs, name));
    if (field->name == "success") group.metrics.back().difference.interval = success;
  }
  mark_clear_lines(group.metrics);
  return group;
}

// The method to compare, or why it cannot be told.
std::expected<std::string, std::string> method_of(const Artifact& artifact, const std::string& wanted,
                                                  std::string_view option) {
  std::vector<std::string> names;
  for (const auto& [name, facts] : artifact.manifest.methods) names.push_back(name);
  if (wanted.empty() && names.size() == 1) return names.front();
  const std::string known = fmt::format("{}", fmt::join(names, ", "));
  if (wanted.empty()) {
    return std::unexpected(fmt::format("{} holds methods {}; say which by {}", artifact.folder.path(), known, option));
  }
  if (std::ranges::find(names, wanted) == names.end()) {
    return std::unexpected(fmt::format("{} holds no method {}, only {}", artifact.folder.path(), wanted, known));
  }
  return wanted;
}

std::map<evidence::PairKey, const evidence::RolloutRow*> rows_by_key(const Artifact& artifact,
                                                                     const std::string& method) {
  std::map<evidence::PairKey, const evidence::RolloutRow*> rows;
  for (const evidence::RolloutRow& row : artifact.rows) {
    if (row.method == method) rows.emplace(evidence::pair_key(row), &row);
  }
  return rows;
}

void pair_rows(const Artifact& a, const Artifact& b, Comparison& out) {
  const auto rows_a = rows_by_key(a, out.a.method);
  const auto rows_b = rows_by_key(b, out.b.method);
  for (const auto& [key, row] : rows_a) {
    const auto partner = rows_b.find(key);
    if (partner != rows_b.end()) out.pairs.push_back({*row, *partner->second});
  }
  out.a.unpaired = rows_a.size() - out.pairs.size();
  out.b.unpaired = rows_b.size() - out.pairs.size();
}

void compare_groups(bool same_contract, Comparison& out) {
  const auto fields = compared_fields(same_contract);
  std::vector<const RowPair*> all;
  std::map<std::tuple<std::string, std::string, double>, std::vector<const RowPair*>> groups;
  for (const RowPair& pair : out.pairs) {
    all.push_back(&pair);
    groups[{pair.a.task, pair.a.perturbation, pair.a.dose}].push_back(&pair);
  }
  for (const auto& [key, pairs] : groups) {
    const auto& [task, perturbation, dose] = key;
    out.groups.push_back(group_of(pairs, fields, fmt::format("{} {}@{:g} ", task, perturbation, dose)));
    std::tie(out.groups.back().task, out.groups.back().perturbation, out.groups.back().dose) = key;
  }
  out.pooled = group_of(all, fields, "all ");
}

std::string contract_text(const TaskFacts& facts) {
  return fmt::format("Pr(age > {:g} ms) <= {:g} %", facts.max_age_ms, 100 * facts.epsilon);
}

// One note per task on which the two methods promise different things. Plants, and with them tasks, are the same.
void note_contracts(const MethodFacts& a, const MethodFacts& b, Comparison& out) {
  for (const auto& [task, facts] : a.tasks) {
    const auto other = b.tasks.find(task);
    if (other == b.tasks.end() || facts.has_contract_of(other->second)) continue;
    out.notes.push_back(fmt::format("miss rates are not compared: on {} A's contract is {}, B's is {}", task,
                                    contract_text(facts), contract_text(other->second)));
  }
}

// The programs' hashes, shortened; a merged artifact has several hosts.
std::set<std::string> builds_of(const Artifact& artifact) {
  constexpr std::size_t kShown = 12;
  std::set<std::string> builds;
  const nlohmann::ordered_json& host = artifact.manifest.host;
  for (const nlohmann::ordered_json& one : host.is_array() ? host : nlohmann::ordered_json::array({host}))
    if (one.is_object() && one.contains(kProgramHash) && one.at(kProgramHash).is_string())
      builds.insert(one.at(kProgramHash).get<std::string>().substr(0, kShown));
  return builds;
}

void add_notes(const Artifact& a, const Artifact& b, Comparison& out) {
  for (const auto& [name, artifact] : {std::pair{"A", &a}, std::pair{"B", &b}}) {
    if (artifact->manifest.complete) continue;
    out.notes.push_back(fmt::format("{} is unfinished: {} of {} planned rollouts", name, artifact->rows.size(),
                                    artifact->manifest.planned_rollouts));
  }
  for (const auto& [name, side] : {std::pair{"A", &out.a}, std::pair{"B", &out.b}}) {
    if (side->unpaired != 0) out.notes.push_back(fmt::format("{} rows of {} have no partner", side->unpaired, name));
  }
  for (const auto& [name, artifact] : {std::pair{"A", &a}, std::pair{"B", &b}}) {
    if (artifact->manifest.until_decided.empty()) continue;
    out.notes.push_back(
        fmt::format("{} ends when success is decided: of success only the line \"at any look\" is valid; intervals "
                    "and p values presume a number of seeds chosen before",
                    name));
  }
  if (contents_of(a.manifest.outside.policy_host) != contents_of(b.manifest.outside.policy_host))
    out.notes.emplace_back("other programs answer for the policies of A than for those of B (--policy-host)");
  if (const auto of_a = builds_of(a), of_b = builds_of(b); !of_a.empty() && !of_b.empty() && of_a != of_b)
    out.notes.push_back(fmt::format("A and B were computed by different builds of the same sources: {} and {}",
                                    fmt::join(of_a, ", "), fmt::join(of_b, ", ")));
  if (a.manifest.script_source_sha256.empty()) {
    out.notes.emplace_back("the script is known by its version only, not by the hash of its sources");
  }
}

Side side_of(const Artifact& artifact, std::string method) {
  Side side{.artifact_id = artifact.manifest.complete ? artifact.manifest.artifact_id : "incomplete",
            .folder = artifact.folder.path(),
            .method = std::move(method),
            .confusion = {}};
  auto confusions = confusions_of(artifact.rows);
  const auto found = confusions.find(side.method);
  if (found != confusions.end() && found->second.macro_recall()) side.confusion = std::move(found->second);
  return side;
}

}  // namespace

std::expected<Comparison, std::string> compare(const Artifact& a, const Artifact& b, const std::string& method_a,
                                               const std::string& method_b) {
  if (const std::string reason = difference_between(a.manifest, b.manifest); !reason.empty()) {
    return std::unexpected(fmt::format("not comparable: {}", reason));
  }
  auto name_a = method_of(a, method_a, "--method-a");
  if (!name_a) return std::unexpected(name_a.error());
  auto name_b = method_of(b, method_b, "--method-b");
  if (!name_b) return std::unexpected(name_b.error());
  if (a.folder.path() == b.folder.path() && *name_a == *name_b) {
    return std::unexpected(fmt::format("both sides are method {} of {}", *name_a, a.folder.path()));
  }
  Comparison out;
  out.a = side_of(a, *name_a);
  out.b = side_of(b, *name_b);
  out.panel = a.manifest.panel;
  pair_rows(a, b, out);
  if (out.pairs.empty()) return std::unexpected("not comparable: no row of A has a partner in B");
  note_contracts(a.manifest.methods.at(*name_a), b.manifest.methods.at(*name_b), out);
  const bool same_contracts = out.notes.empty();
  compare_groups(same_contracts, out);
  add_notes(a, b, out);
  return out;
}

void name_configuration(const Artifact& a, const Artifact& b, const PanelPromise& promise, Comparison& comparison) {
  const auto of_a = promise.methods.find(comparison.a.method), of_b = promise.methods.find(comparison.b.method);
  if (of_a == promise.methods.end() || of_b == promise.methods.end()) {
    comparison.notes.emplace_back("panel.yaml does not name both methods, so nothing says how they differ");
    return;
  }
  std::map<std::string, ConfigurationDifference> differences;
  for (const auto& [key, value] : of_a->second) differences[key].a = value;
  for (const auto& [key, value] : of_b->second) differences[key].b = value;
  comparison.configuration.emplace();
  for (auto& [key, one] : differences) {
    one.key = key;
    if (one.a != one.b) comparison.configuration->push_back(one);
  }
  for (const auto& [task, facts] : a.manifest.methods.at(comparison.a.method).tasks) {
    const auto& tasks = b.manifest.methods.at(comparison.b.method).tasks;
    const auto other = tasks.find(task);
    if (other == tasks.end() || !comparison.configuration->empty()) continue;
    if (facts.config_sha256 != other->second.config_sha256)
      comparison.notes.push_back(
          fmt::format("on {} the robot files of A and B differ, and panel.yaml does not say how", task));
  }
}

}  // namespace takt::lab
