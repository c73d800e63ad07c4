// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/rollout_fields.hpp"

namespace takt::lab {
namespace {

constexpr Range kNotNegative{.low = 0};
constexpr Range kShare{.low = 0, .high = 1};

std::function<FieldPlace(evidence::RolloutRow&)> at(auto evidence::RolloutRow::*member) {
  return [member](evidence::RolloutRow& row) -> FieldPlace { return &(row.*member); };
}

std::function<FieldPlace(evidence::RolloutRow&)> at(auto evidence::RolloutRow::*group, auto member) {
  return [group, member](evidence::RolloutRow& row) -> FieldPlace { return &(row.*group.*member); };
}

using Fields = std::vector<RolloutField>;

void add_text(Fields& fields, std::string name, std::string evidence::RolloutRow::*member, TextFormat format,
              std::string meaning) {
  fields.push_back({std::move(name), "", std::move(meaning), at(member), format, {}});
}

void add_identity(Fields& fields) {
  using enum TextFormat;
  add_text(fields, "schema", &evidence::RolloutRow::schema, schema, "version of this row's layout");
  add_text(fields, "panel", &evidence::RolloutRow::panel, token, "panel that planned the rollout");
  add_text(fields, "panel_sha256", &evidence::RolloutRow::panel_sha256, sha256, "of the panel file's bytes");
  add_text(fields, "task", &evidence::RolloutRow::task, token, "what the robot had to do");
  add_text(fields, "method", &evidence::RolloutRow::method, token, "policy and settings under test");
  fields.push_back({"seed", "1", "seed of everything random in the rollout", at(&evidence::RolloutRow::seed)});
  add_text(fields, "perturbation", &evidence::RolloutRow::perturbation, token,
           "named disturbance; none for the nominal rollout");
  fields.push_back(
      {"dose", "", "strength, in the perturbation's own unit; 0 when nominal", at(&evidence::RolloutRow::dose)});
  add_text(fields, "config_sha256", &evidence::RolloutRow::config_sha256, sha256,
           "of the method's resolved robot file");
  add_text(fields, "policy_sha256", &evidence::RolloutRow::policy_sha256, optional_sha256,
           "of the policy file; empty: none");
  add_text(fields, "plant_sha256", &evidence::RolloutRow::plant_sha256, sha256, "of the simulated plant's text");
  add_text(fields, "script.version", &evidence::RolloutRow::script_version, version, "takt that computed the row");
  add_text(fields, "script.source_sha256", &evidence::RolloutRow::script_source_sha256, optional_sha256,
           "of the sources it was built from; empty: not known");
}

void add_outcome(Fields& fields) {
  fields.push_back({"success", "", "the task was done as the panel demands", at(&evidence::RolloutRow::success)});
  add_text(fields, "failure_label", &evidence::RolloutRow::failure_label, TextFormat::label,
           "why it failed, in a word; empty exactly on success");
  fields.push_back({"fell", "", "it fell, or lost what it balances, at any time: before a stop, by it or without one",
                    at(&evidence::RolloutRow::fell)});
  fields.push_back({"monitor_state.mode", "", "mode after the last tick", at(&evidence::RolloutRow::final_mode)});
  fields.push_back({"monitor_state.cause", "", "cause of the last transition", at(&evidence::RolloutRow::final_cause)});
  add_text(fields, "faults.leading", &evidence::RolloutRow::leading_fault, TextFormat::fault,
           "costliest verdict of the fault classifier, stops first; empty exactly without any trouble");
  fields.push_back({"faults.verdicts", "1", "verdicts on stretches of trouble, one for each cause of a stretch",
                    at(&evidence::RolloutRow::fault_verdicts)});
  for (std::size_t fault = 0; fault < monitor::kFaultCount; ++fault) {
    fields.push_back({"faults.shares." + std::string(monitor::kFaultNames[fault]),
                      "1",
                      "share of the troubled ticks that this verdict explains; 0 without any",
                      [fault](evidence::RolloutRow& row) -> FieldPlace { return &row.fault_shares[fault]; },
                      {},
                      kShare,
                      true});
  }
  for (std::size_t score = 0; score < config::kChunkScoreCount; ++score) {
    fields.push_back({"chunk_levels." + std::string(config::kChunkScoreNames[score]),
                      "1",
                      "largest value that as many neighbouring answers reached as a catch takes",
                      [score](evidence::RolloutRow& row) -> FieldPlace { return &row.chunk_levels[score]; },
                      {},
                      kNotNegative});
  }
  fields.push_back({"catch_votes", "1", "answers that a catch takes", at(&evidence::RolloutRow::catch_votes)});
  fields.push_back({"catch_of", "1", "of so many of the newest", at(&evidence::RolloutRow::catch_of)});
  fields.push_back({"catches", "1", "of the chunk monitors, where the robot file has thresholds",
                    at(&evidence::RolloutRow::catches)});
  fields.push_back({"recovery_s",
                    "s",
                    "end of the perturbation to tracking again; null: nothing to recover from, or never recovered",
                    at(&evidence::RolloutRow::recovery_s),
                    {},
                    kNotNegative});
  fields.push_back({"rearms", "1", "times the operator armed the robot again", at(&evidence::RolloutRow::rearms)});
  fields.push_back({"tracking_error_rms_m",
                    "m",
                    "error of the task's controlled point, over scored ticks",
                    at(&evidence::RolloutRow::tracking_error_rms_m),
                    {},
                    kNotNegative});
  fields.push_back({"tracking_error_p95_m",
                    "m",
                    "the same error, p95 over scored ticks",
                    at(&evidence::RolloutRow::tracking_error_p95_m),
                    {},
                    kNotNegative});
  fields.push_back({"constraint_violations", "1", "ticks outside the task's own constraints",
                    at(&evidence::RolloutRow::constraint_violations)});
}

struct AgePart {
  const char* name;
  evidence::AgeQuantiles evidence::AgeRow::*part;
};
struct AgeQuantile {
  const char* name;
  std::optional<double> evidence::AgeQuantiles::*quantile;
};
constexpr AgePart kAgeParts[] = {{"total", &evidence::AgeRow::total},     {"sense", &evidence::AgeRow::sense},
                                 {"queue", &evidence::AgeRow::queue},     {"infer", &evidence::AgeRow::infer},
                                 {"publish", &evidence::AgeRow::publish}, {"hold", &evidence::AgeRow::hold}};
constexpr AgeQuantile kAgeQuantiles[] = {{"p50", &evidence::AgeQuantiles::p50_ms},
                                         {"p95", &evidence::AgeQuantiles::p95_ms},
                                         {"p99", &evidence::AgeQuantiles::p99_ms}};

void add_ages(Fields& fields, const std::string& name, evidence::AgeRow evidence::RolloutRow::*age,
              const std::string& over) {
  for (const AgePart& part : kAgeParts) {
    for (const AgeQuantile& quantile : kAgeQuantiles) {
      fields.push_back({name + "." + part.name + "." + quantile.name + "_ms",
                        "ms",
                        std::string(quantile.name) + " of " + part.name + " age " + over + "; null: no sample",
                        [age, part = part.part, quantile = quantile.quantile](evidence::RolloutRow& row) -> FieldPlace {
                          return &(row.*age.*part.*quantile);
                        },
                        {},
                        {}});
    }
  }
}

void add_misses(Fields& fields, const std::string& name, evidence::MissRow evidence::RolloutRow::*misses,
                const std::string& what) {
  fields.push_back({name + ".misses", "1", what + " that missed the deadline", at(misses, &evidence::MissRow::misses)});
  fields.push_back({name + ".count", "1", what + " judged", at(misses, &evidence::MissRow::count)});
  fields.push_back(
      {name + ".rate", "1", "misses / count; 0 without any", at(misses, &evidence::MissRow::rate), {}, kShare});
  fields.push_back({name + ".effective_count",
                    "1",
                    "independent " + what + " that say as much, at most count",
                    at(misses, &evidence::MissRow::effective_count),
                    {},
                    {}});
  fields.push_back({name + ".upper_bound",
                    "1",
                    "one-sided Clopper-Pearson bound of the rate, of effective_count samples",
                    at(misses, &evidence::MissRow::upper_bound),
                    {},
                    kShare});
}

void add_latency(Fields& fields) {
  fields.push_back({"ticks", "1", "of the rollout", at(&evidence::RolloutRow::ticks)});
  fields.push_back({"inference_mean_ms", "ms", "mean inference time of accepted commands; null: there was none",
                    at(&evidence::RolloutRow::inference_mean_ms)});
  add_ages(fields, "age_per_command", &evidence::RolloutRow::age_per_command, "at first use");
  add_ages(fields, "age_per_tick", &evidence::RolloutRow::age_per_tick, "at ticks that relied on the policy");
  add_misses(fields, "misses_per_command", &evidence::RolloutRow::misses_per_command, "commands");
  add_misses(fields, "misses_per_tick", &evidence::RolloutRow::misses_per_tick, "ticks");
}

void add_safety(Fields& fields) {
  const auto add = [&](const char* name, std::uint64_t evidence::SafetyEvents::*member, const char* meaning) {
    fields.push_back({std::string("safety.") + name, "1", meaning, at(&evidence::RolloutRow::safety, member)});
  };
  add("entered_degraded", &evidence::SafetyEvents::entered_degraded, "transitions into degraded");
  add("entered_damped_stop", &evidence::SafetyEvents::entered_damped_stop, "transitions into damped_stop");
  add("entered_fault_latched", &evidence::SafetyEvents::entered_fault_latched, "transitions into fault_latched");
  add("envelope_violations", &evidence::SafetyEvents::envelope_violations, "ticks measured outside the hard envelope");
  for (std::size_t kind = 0; kind < kInterventionCount; ++kind) {
    fields.push_back({"interventions." + std::string(kInterventionNames[kind]), "1", "joint-ticks it acted",
                      [kind](evidence::RolloutRow& row) -> FieldPlace { return &row.interventions[kind]; }});
  }
  for (std::size_t mode = 0; mode < kModeCount; ++mode) {
    fields.push_back({"mode_share." + std::string(name(static_cast<Mode>(mode))),
                      "1",
                      "share of ticks in the mode",
                      [mode](evidence::RolloutRow& row) -> FieldPlace { return &row.mode_share[mode]; },
                      {},
                      kShare});
  }
  fields.push_back({"energy_J",
                    "J",
                    "integral of |torque * velocity| over all joints",
                    at(&evidence::RolloutRow::energy_J),
                    {},
                    kNotNegative});
  fields.push_back({"peak_torque_Nm",
                    "Nm",
                    "largest |torque| of any joint; of a slide, at its motor",
                    at(&evidence::RolloutRow::peak_torque_Nm),
                    {},
                    kNotNegative});
  fields.push_back({"torque_rate_Nm_s",
                    "Nm/s",
                    "mean |change of torque| per time, summed over all joints; of a slide, at its motor",
                    at(&evidence::RolloutRow::torque_rate_Nm_s),
                    {},
                    kNotNegative});
  fields.push_back({"peak_reference_jerk",
                    "rad/s^3",
                    "largest |jerk| of any joint's reference while the policy was played; of a slide, at its motor",
                    at(&evidence::RolloutRow::peak_reference_jerk),
                    {},
                    kNotNegative});
  fields.push_back({"peak_join_velocity_step",
                    "rad/s",
                    "largest change of any joint's reference velocity in a tick in which a new command took over; of a "
                    "slide, at its motor",
                    at(&evidence::RolloutRow::peak_join_velocity_step),
                    {},
                    kNotNegative});
}

void add_evidence(Fields& fields) {
  add_text(fields, "replay_hash", &evidence::RolloutRow::replay_hash, TextFormat::hex, "over all tick records");
  add_text(fields, "run_folder", &evidence::RolloutRow::run_folder, TextFormat::path, "kept recording; empty: none");
  const auto host = [&](const char* name, const char* unit, auto evidence::HostMeasured::*member, const char* meaning) {
    fields.push_back(
        {std::string("host.") + name, unit, meaning, at(&evidence::RolloutRow::host, member), {}, kNotNegative});
  };
  host("wall_s", "s", &evidence::HostMeasured::wall_s, "time the rollout took here");
  host("cpu_s", "s", &evidence::HostMeasured::cpu_s, "processor time it took here");
  host("peak_rss_kib", "KiB", &evidence::HostMeasured::peak_rss_kib, "largest resident memory of the process so far");
  host("realtime_factor", "1", &evidence::HostMeasured::realtime_factor, "simulated time / wall time");
}

Fields make_fields() {
  Fields fields;
  add_identity(fields);
  add_outcome(fields);
  add_latency(fields);
  add_safety(fields);
  add_evidence(fields);
  return fields;
}

}  // namespace

const std::vector<RolloutField>& rollout_fields() {
  static const Fields kFields = make_fields();
  return kFields;
}

FieldPlace place_in(const RolloutField& field, const evidence::RolloutRow& row) {
  return field.place(
      const_cast<evidence::RolloutRow&>(row));  // one table serves reading and writing; callers here only read
}

bool is_lacking(const RolloutField& field, const evidence::RolloutRow& row) {
  if (!field.is_added) return false;
  const FieldPlace place = place_in(field, row);
  const auto* const* number = std::get_if<std::optional<double>*>(&place);
  return number != nullptr && !(*number)->has_value();
}

std::string_view type_name(const FieldPlace& place) {
  struct Names {
    std::string_view operator()(const bool*) const { return "true or false"; }
    std::string_view operator()(const std::uint64_t*) const { return "a whole number"; }
    std::string_view operator()(const double*) const { return "a number"; }
    std::string_view operator()(const std::optional<double>*) const { return "a number or null"; }
    std::string_view operator()(const std::string*) const { return "a text"; }
    std::string_view operator()(const Mode*) const { return "the name of a mode"; }
    std::string_view operator()(const Cause*) const { return "the name of a cause"; }
  };
  return std::visit(Names{}, place);
}

}  // namespace takt::lab
