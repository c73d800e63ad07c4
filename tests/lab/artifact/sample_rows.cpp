// SPDX-License-Identifier: Apache-2.0
#include "tests/lab/artifact/sample_rows.hpp"

#include <string>

#include "config/load.hpp"
#include "monitor/judge/freshness_statistics.hpp"

namespace takt::lab {
namespace {

evidence::AgeRow ages(double base) {
  evidence::AgeRow row;
  row.total = {.p50_ms = base, .p95_ms = base + 0.1, .p99_ms = base + 0.3};
  double next = base / 10;
  for (evidence::AgeQuantiles* part : {&row.sense, &row.queue, &row.infer, &row.publish, &row.hold}) {
    *part = {.p50_ms = next, .p95_ms = next + 0.1, .p99_ms = next + 0.3};
    next += 1.0;
  }
  return row;
}

evidence::MissRow missed(std::uint64_t misses, std::uint64_t count) {
  return {.misses = misses,
          .count = count,
          .rate = static_cast<double>(misses) / static_cast<double>(count),
          .effective_count = static_cast<double>(count),
          .upper_bound = monitor::clopper_pearson_upper(misses, count, 0.95)};
}

}  // namespace

evidence::RolloutRow sample_row(const std::string& method, std::uint64_t seed) {
  evidence::RolloutRow row;
  row.panel = "smoke";
  row.panel_sha256 = config::sha256_hex("panel");
  row.task = "reach";
  row.method = method;
  row.seed = seed;
  row.perturbation = "none";
  row.config_sha256 = config::sha256_hex("config " + method);
  row.policy_sha256 = config::sha256_hex("policy");
  row.plant_sha256 = config::sha256_hex("plant");
  row.script_version = "0.1.0";
  row.script_source_sha256 = config::sha256_hex("sources");
  row.success = true;
  row.final_mode = Mode::tracking;
  row.final_cause = Cause::drives_enabled;
  row.recovery_s = 0.25;
  row.leading_fault = "inference_stall";
  row.fault_verdicts = 2;
  row.fault_shares.fill(0);
  row.fault_shares[static_cast<std::size_t>(monitor::Fault::inference_stall)] = 1;
  row.rearms = 5;
  row.tracking_error_rms_m = 0.01;
  row.tracking_error_p95_m = 0.03;
  row.constraint_violations = 4;
  row.ticks = 2000;
  row.inference_mean_ms = 14.5;
  row.age_per_command = ages(20);
  row.age_per_tick = ages(30);
  row.misses_per_command = missed(1, 100);
  row.misses_per_tick = missed(3, 1000);
  row.safety = {1, 2, 3, 4};
  for (std::size_t kind = 0; kind < kInterventionCount; ++kind) row.interventions[kind] = 100 + kind;
  row.mode_share = {0.1, 0.05, 0.8, 0.03, 0.02, 0.0};
  row.energy_J = 12.5;
  row.peak_torque_Nm = 7.25;
  row.peak_reference_jerk = 310.5;
  row.torque_rate_Nm_s = 62.5;
  row.peak_join_velocity_step = 0.125;
  row.replay_hash = config::sha256_hex(method + std::to_string(seed)).substr(0, 16);
  row.run_folder = "runs/reach-1";
  row.host = {.wall_s = 0.5, .cpu_s = 0.4, .peak_rss_kib = 20480, .realtime_factor = 4.0};
  return row;
}

evidence::RolloutRow failed_row(const std::string& method, std::uint64_t seed) {
  evidence::RolloutRow row = sample_row(method, seed);
  row.success = false;
  row.failure_label = "command_lost";
  row.fell = true;
  row.final_mode = Mode::damped_stop;
  row.final_cause = Cause::command_lost;
  row.recovery_s.reset();
  row.replay_hash = config::sha256_hex(row.replay_hash).substr(0, 16);
  return row;
}

}  // namespace takt::lab
