// SPDX-License-Identifier: Apache-2.0
#include "lab/study/ablation.hpp"

#include <fmt/format.h>

#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "config/hash.hpp"
#include "lab/judge/paired_statistics.hpp"
#include "lab/panel/panel_plan.hpp"
#include "lab/panel/worker_pool.hpp"

namespace takt::study {
namespace {

// A panel that exists in memory only.
lab::Panel panel_of(const AblationSetup& setup) {
  lab::Panel made;
  made.file = setup.robot_file;
  made.name = "ablation";
  made.text = "takt ablate " + setup.robot_file;
  made.sha256 = config::sha256_hex(made.text);
  made.duration = setup.duration;
  made.seed_count = setup.seeds;
  made.timing.inference = milliseconds(2);  // no part of what is asked: the policy is in time
  made.tasks.push_back({.task = setup.task,
                        .robot = setup.robot_file,
                        .scored = setup.scored,
                        .bound_m = setup.bound_m,
                        .base_velocity = setup.base_velocity});
  for (const evidence::BuiltIn which : {evidence::BuiltIn::takt, evidence::BuiltIn::plain}) {
    const evidence::BuiltInMethod& method = evidence::built_in_methods()[static_cast<std::size_t>(which)];
    made.methods.push_back({std::string(method.name), std::string(method.description), false, {}, {which}});
  }
  for (const evidence::ProtectionName& one : evidence::protections())
    made.methods.push_back({"without_" + std::string(one.name),
                            std::string(one.meaning),
                            false,
                            {},
                            {evidence::BuiltIn::takt, one.which}});
  made.perturbations.push_back({});
  made.perturbations.push_back(
      {.kind = "policy_freeze", .dose = setup.frozen_for.milliseconds(), .from = setup.frozen_at, .length = {}});
  return made;
}

void add(const evidence::RolloutRow& row, double joints, bool takt_succeeds, AblationRow& sum) {
  ++sum.rollouts;
  sum.successes += row.success ? 1U : 0U;
  sum.fell += row.fell ? 1U : 0U;
  sum.only_this += row.success && !takt_succeeds ? 1U : 0U;
  sum.only_takt += takt_succeeds && !row.success ? 1U : 0U;
  sum.tracking_error_m += row.tracking_error_rms_m;
  sum.torque_rate_Nm_s += row.torque_rate_Nm_s;
  sum.energy_J += row.energy_J;
  const auto marks = std::accumulate(row.interventions.begin(), row.interventions.end(), std::uint64_t{0});
  if (row.ticks != 0) sum.marks += static_cast<double>(marks) / (static_cast<double>(row.ticks) * joints);
}

void divide(AblationRow& sum) {
  const double n = sum.rollouts != 0 ? static_cast<double>(sum.rollouts) : 1.0;
  sum.tracking_error_m /= n;
  sum.torque_rate_Nm_s /= n;
  sum.energy_J /= n;
  sum.marks /= n;
}

std::string lines(const std::vector<AblationRow>& rows) {
  std::string text = fmt::format("{:<22} {:>9} {:>5} {:>7} {:>15} {:>8} {:>10} {:>9} {:>7}  {}\n", "", "success",
                                 "fell", "points", "95 %", "error mm", "Nm/s", "J", "marks", "");
  for (const AblationRow& row : rows) {
    const lab::Interval difference = lab::paired_rate_interval(row.only_this, row.only_takt, row.rollouts);
    const bool is_takt = &row == &rows.front();
    const double points = 100 * (static_cast<double>(row.only_this) - static_cast<double>(row.only_takt)) /
                          static_cast<double>(row.rollouts);
    text += fmt::format("{:<22} {:>9} {:>5} {:>7} {:>15} {:>8.1f} {:>10.1f} {:>9.1f} {:>7.3f}  {}\n", row.name,
                        fmt::format("{}/{}", row.successes, row.rollouts), row.fell,
                        is_takt ? "" : fmt::format("{:+.1f}", points),
                        is_takt ? "" : fmt::format("[{:+.1f} {:+.1f}]", 100 * difference.low, 100 * difference.high),
                        row.tracking_error_m * 1e3, row.torque_rate_Nm_s, row.energy_J, row.marks, row.meaning);
  }
  return text;
}

nlohmann::ordered_json json_of(const std::vector<AblationRow>& rows) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const AblationRow& row : rows)
    list.push_back({{"name", row.name},
                    {"rollouts", row.rollouts},
                    {"successes", row.successes},
                    {"fell", row.fell},
                    {"only_this", row.only_this},
                    {"only_takt", row.only_takt},
                    {"tracking_error_m", row.tracking_error_m},
                    {"torque_rate_Nm_s", row.torque_rate_Nm_s},
                    {"energy_J", row.energy_J},
                    {"marks_per_joint_tick", row.marks}});
  return list;
}

}  // namespace

std::expected<Ablation, std::string> ablate(const AblationSetup& setup) {
  auto contest = lab::Contest::prepare(panel_of(setup));
  if (!contest) return std::unexpected(contest.error());
  const auto plan = lab::plan_of(contest->panel(), {});
  const auto joints = static_cast<double>(contest->contestant(plan.front()).robot.joints.size());
  Ablation found{.frozen_for = setup.frozen_for};
  for (const lab::PanelMethod& method : contest->panel().methods) {
    found.nominal.push_back({.name = method.name, .meaning = method.description});
    found.frozen.push_back({.name = method.name, .meaning = method.description});
  }
  std::map<evidence::PairKey, bool> takt;  // its rows come first
  std::size_t done = 0;
  const auto ran = lab::run_in_workers(*contest, plan, setup.workers, [&](const lab::RanRollout& one) {
    const lab::PlannedRollout& planned = plan[done];
    if (planned.method == 0) takt.emplace(evidence::pair_key(one.row), one.row.success);
    auto& rows = planned.perturbation == 0 ? found.nominal : found.frozen;
    add(one.row, joints, takt.at(evidence::pair_key(one.row)), rows[planned.method]);
    ++done;
    if (setup.on_progress) setup.on_progress(done, plan.size());
    return std::expected<void, std::string>{};
  });
  if (!ran) return std::unexpected(ran.error());
  for (auto* rows : {&found.nominal, &found.frozen})
    for (AblationRow& row : *rows) divide(row);
  return found;
}

std::string ablation_text(const Ablation& ablation) {
  return fmt::format("without a fault\n{}\nthe policy stands still for {:.0f} ms\n{}", lines(ablation.nominal),
                     ablation.frozen_for.milliseconds(), lines(ablation.frozen));
}

nlohmann::ordered_json to_json(const Ablation& ablation) {
  return {{"nominal", json_of(ablation.nominal)},
          {"frozen_for_ms", ablation.frozen_for.milliseconds()},
          {"frozen", json_of(ablation.frozen)}};
}

}  // namespace takt::study
