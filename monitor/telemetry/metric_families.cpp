// SPDX-License-Identifier: Apache-2.0
#include "monitor/telemetry/metric_families.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "config/joint_units.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "executive/contract/feedback_names.hpp"
#include "executive/contract/tick_facts.hpp"

namespace takt::monitor {
namespace {

using Label = std::pair<std::string_view, std::string_view>;

class Families {
 public:
  void family(MetricFamily family) { all_.push_back(std::move(family)); }
  // Of the newest family.
  template <class Number>
  void sample(Number value, std::initializer_list<Label> labels = {}) {
    MetricSample& sample = all_.back().samples.emplace_back();
    for (const auto& [key, text] : labels) sample.labels.emplace_back(key, text);
    if constexpr (std::is_integral_v<Number>)
      sample.value = static_cast<std::uint64_t>(value);
    else
      sample.value = value;
  }
  void histogram(const Histogram& histogram, std::initializer_list<Label> labels = {}) { sample(&histogram, labels); }
  std::vector<MetricFamily> take() { return std::move(all_); }

 private:
  std::vector<MetricFamily> all_;
};

void contract(Families& out, const LiveMetrics& metrics, const config::RobotConfig& robot) {
  out.family({"takt.freshness.max_age", "takt_freshness_max_age_seconds", "s", MetricKind::gauge,
              "Oldest command that may move the robot."});
  out.sample(robot.freshness.max_age.seconds());
  out.family({"takt.freshness.epsilon", "takt_freshness_epsilon_ratio", "1", MetricKind::gauge,
              "Share of ticks that the contract lets miss."});
  out.sample(robot.freshness.epsilon);
  out.family(
      {"takt.relied_ticks", "takt_relied_ticks_total", "", MetricKind::counter, "Ticks that relied on the policy."});
  out.sample(metrics.relied_ticks);
  out.family({"takt.deadline_misses", "takt_deadline_misses_total", "", MetricKind::counter,
              "Relied ticks whose command was stale or missing."});
  out.sample(metrics.deadline_misses);
  out.family({"takt.window_misses", "takt_window_misses_ratio", "1", MetricKind::gauge,
              "Share of misses in the contract's sliding window, now."});
  out.sample(window_miss_share(metrics.newest));
  out.family({"takt.command.age", "takt_command_age_seconds", "s", MetricKind::histogram,
              "Age of the command in use, at each relied tick."});
  out.histogram(metrics.age);
  out.family({"takt.command.stage", "takt_command_stage_seconds", "s", MetricKind::histogram,
              "Parts of a command's age at its first use."});
  for (std::size_t stage = 0; stage < kAgeStageCount; ++stage)
    out.histogram(metrics.stages[stage], {{"stage", kAgeStageNames[stage]}});
  out.family({"takt.command.arrivals", "takt_command_arrivals_total", "", MetricKind::counter,
              "Looks into the policy's mailbox, by what they found."});
  for (std::size_t i = 0; i < kArrivalCount; ++i)
    out.sample(metrics.arrivals[i], {{"arrival", name(static_cast<Arrival>(i))}});
}

// Those that the robot file watches for, each from 0 on.
void catches(Families& out, const LiveMetrics& metrics, const config::RobotConfig& robot) {
  if (!robot.policy || !robot.policy->monitors) return;
  out.family({"takt.policy.catches", "takt_policy_catches_total", "", MetricKind::counter,
              "Catches of the chunk monitors, by score."});
  for (const config::ChunkThreshold& one : robot.policy->monitors->thresholds)
    out.sample(metrics.catches[static_cast<std::size_t>(one.score)], {{"score", name(one.score)}});
}

void modes(Families& out, const LiveMetrics& metrics) {
  out.family({"takt.mode", "takt_mode", "", MetricKind::gauge, "1 for the mode the executive is in."});
  for (std::size_t i = 0; i < kModeCount; ++i) {
    const auto mode = static_cast<Mode>(i);
    out.sample(metrics.is_in(mode) ? 1 : 0, {{"mode", name(mode)}});
  }
  out.family({"takt.player", "takt_player", "", MetricKind::gauge, "1 for the policy whose chunk the robot follows."});
  for (std::size_t i = 0; i < kMoverCount; ++i) {
    const auto player = static_cast<Player>(i);
    out.sample(metrics.running && metrics.newest.tick != 0 && metrics.newest.player == player ? 1 : 0,
               {{"player", name(player)}});
  }
  out.family({"takt.fallback.usable", "takt_fallback_usable", "", MetricKind::gauge,
              "1 while the fallback policy's command is fresh; none of a robot without one."});
  if (metrics.newest.seats[Seat::fallback].session != 0)
    out.sample(metrics.running && is_usable(metrics.newest.seats[Seat::fallback].freshness) ? 1 : 0);
  out.family(
      {"takt.candidate.in_charge", "takt_candidate_in_charge", "", MetricKind::gauge,
       "1 while a candidate is in charge of the robot, 0 while it runs beside its policy; none before one came."});
  if (metrics.newest.candidate.policy_hash != 0)
    out.sample(metrics.running && metrics.newest.candidate.in_charge != 0 ? 1 : 0);
  out.family({"takt.policy.changes", "takt_policy_changes_total", "", MetricKind::counter,
              "What became of changes of policy on the live robot."});
  for (std::size_t i = 1; i < kPolicyChangeCount; ++i)
    out.sample(metrics.policy_changes[i], {{"change", name(static_cast<PolicyChange>(i))}});
  out.family({"takt.mode.transitions", "takt_mode_transitions_total", "", MetricKind::counter,
              "Changes of mode, by the mode entered and the cause."});
  for (const auto& [change, times] : metrics.transitions)
    out.sample(times, {{"mode", name(change.first)}, {"cause", name(change.second)}});
}

// Labels of which there are as many as joints, buses and causes: never the sentence, which has numbers in it.
void incident(Families& out, const LiveMetrics& metrics, const config::RobotConfig& robot) {
  out.family({"takt.incident", "takt_incident", "", MetricKind::gauge,
              "1 while the robot stands in a stop or fault, by what it is about."});
  const incident::Incident* const standing = metrics.standing();
  if (standing == nullptr)
    return out.sample(0, {{"mode", "none"}, {"cause", "none"}, {"where", robot.robot}, {"asked", "no"}});
  out.sample(1, {{"mode", name(standing->to)},
                 {"cause", name(standing->cause)},
                 {"where", standing->where.empty() ? robot.robot : standing->where},
                 {"asked", standing->asked ? "yes" : "no"}});
}

void loop(Families& out, const LiveMetrics& metrics, const config::RobotConfig& robot) {
  out.family({"takt.up", "takt_up", "", MetricKind::gauge, "1 while an executive runs and is recorded."});
  out.sample(metrics.recording ? 1 : 0);
  if (!metrics.run_id.empty()) {
    out.family({"takt.run.info", "takt_run_info", "", MetricKind::gauge, "Always 1; what runs is in the labels."});
    out.sample(1, {{"run_id", metrics.run_id}, {"config_sha256", robot.sha256}});
  }
  out.family({"takt.control.period", "takt_control_period_seconds", "s", MetricKind::gauge,
              "Configured period of the control loop."});
  out.sample(robot.control.period.seconds());
  out.family({"takt.ticks", "takt_ticks_total", "", MetricKind::counter, "Ticks of the control loop."});
  out.sample(metrics.ticks);
  out.family({"takt.wakeup.lateness", "takt_wakeup_lateness_seconds", "s", MetricKind::histogram,
              "How late the control thread woke."});
  out.histogram(metrics.lateness);
  out.family(
      {"takt.tick.duration", "takt_tick_duration_seconds", "s", MetricKind::histogram, "How long a tick worked."});
  out.histogram(metrics.work);
  out.family({"takt.overruns", "takt_overruns_total", "", MetricKind::counter, "Periods that ended late, by cause."});
  for (std::size_t i = 1; i < kOverrunCauseCount; ++i)
    out.sample(metrics.overruns[i], {{"cause", name(static_cast<OverrunCause>(i))}});
  out.family({"takt.skipped_periods", "takt_skipped_periods_total", "", MetricKind::counter,
              "Periods in which the loop did not run."});
  out.sample(metrics.skipped_periods);
  if (!std::isnan(metrics.hours_left)) {
    out.family({"takt.record.hours_left", "takt_record_hours_left", "h", MetricKind::gauge,
                "Until the disk of the runs is full; +Inf: record.keep makes room."});
    out.sample(metrics.hours_left);
  }
  out.family({"takt.record.losses", "takt_record_losses_total", "", MetricKind::counter,
              "Entries the monitor could not record, by ring and reason."});
  for (const auto& [what, entries] : metrics.losses)
    out.sample(entries, {{"ring", what.first}, {"reason", what.second}});
}

void buses(Families& out, const LiveMetrics& metrics, const config::RobotConfig& robot) {
  const auto each = [&](auto say) {
    for (std::size_t bus = 0; bus < metrics.newest.bus_count && bus < robot.buses.size(); ++bus)
      say(robot.buses[bus].name, metrics.newest.buses[bus]);
  };
  out.family({"takt.bus.state", "takt_bus_state", "", MetricKind::gauge, "1 for the state a CAN bus is in."});
  each([&](std::string_view bus, const BusHealth& health) {
    for (std::size_t i = 0; i < kBusStateNames.size(); ++i)
      out.sample(static_cast<std::size_t>(health.state) == i ? 1 : 0, {{"bus", bus}, {"state", kBusStateNames[i]}});
  });
  out.family({"takt.bus.dropped_frames", "takt_bus_dropped_frames_total", "", MetricKind::counter,
              "Frames lost on our side since the executive started."});
  each([&](std::string_view bus, const BusHealth& health) {
    out.sample(health.tx_dropped, {{"bus", bus}, {"direction", "transmit"}});
    out.sample(health.rx_dropped, {{"bus", bus}, {"direction", "receive"}});
  });
  out.family({"takt.bus.tick_to_wire", "takt_bus_tick_to_wire_seconds", "s", MetricKind::histogram,
              "From a tick's begin until its frames had left, where the controller says."});
  for (std::size_t bus = 0; bus < robot.buses.size(); ++bus)
    out.histogram(metrics.tick_to_wire[bus], {{"bus", robot.buses[bus].name}});
  out.family({"takt.command.age_on_wire", "takt_command_age_on_wire_seconds", "s", MetricKind::histogram,
              "Age of the command played when its frames had left, by tick and bus that says."});
  out.histogram(metrics.age_on_wire);
  out.family({"takt.bus.foreign_frames", "takt_bus_foreign_frames_total", "", MetricKind::counter,
              "Frames on our ids that none of our drives sends."});
  each([&](std::string_view bus, const BusHealth& health) { out.sample(health.foreign_frames, {{"bus", bus}}); });
}

void joints(Families& out, const LiveMetrics& metrics, const config::RobotConfig& robot) {
  using config::JointKind;
  const auto gauge = [&](std::string_view otlp, std::string_view prometheus, std::string_view unit,
                         std::string_view help, std::initializer_list<JointKind> kinds, auto value) {
    out.family({otlp, prometheus, unit, MetricKind::gauge, help});
    if (metrics.newest.tick == 0) return;
    for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
      if (std::ranges::find(kinds, robot.joints[joint].kind) != kinds.end())
        out.sample(value(metrics.joints[joint]), {{"joint", robot.joints[joint].name}});
  };
  const auto position = [](const JointRecord& j) { return j.feedback.q; };
  const auto velocity = [](const JointRecord& j) { return j.dq_estimate; };
  const auto torque = [](const JointRecord& j) { return j.feedback.tau; };
  gauge("takt.joint.position", "takt_joint_position_radians", "rad", "Measured position.", {JointKind::hinge},
        position);
  gauge("takt.joint.velocity", "takt_joint_velocity_radians_per_second", "rad/s", "Estimated velocity.",
        {JointKind::hinge}, velocity);
  gauge("takt.joint.torque", "takt_joint_torque_newton_meters", "N.m", "Torque the drive reports.", {JointKind::hinge},
        torque);
  if (config::has_slides(robot)) {
    gauge("takt.slide.position", "takt_joint_position_meters", "m", "Measured position of a slide.", {JointKind::slide},
          position);
    gauge("takt.slide.velocity", "takt_joint_velocity_meters_per_second", "m/s", "Estimated velocity of a slide.",
          {JointKind::slide}, velocity);
    gauge("takt.slide.force", "takt_joint_force_newtons", "N", "Force of a slide by what its drive reports.",
          {JointKind::slide}, torque);
  }
  gauge("takt.joint.temperature", "takt_joint_temperature_celsius", "Cel",
        "Hottest part the drive reports; 0 when it reports none.", {JointKind::hinge, JointKind::slide},
        [](const JointRecord& j) { return j.feedback.temperature_C; });
  gauge("takt.joint.error_code", "takt_joint_error_code", "", "The drive's own error code; 0 none.",
        {JointKind::hinge, JointKind::slide}, [](const JointRecord& j) { return j.feedback.error_code; });
  out.family({"takt.joint.error", "takt_joint_error", "", MetricKind::gauge,
              "1 while a drive reports an error, in its own words."});
  for (std::size_t joint = 0; joint < robot.joints.size() && metrics.newest.tick != 0; ++joint)
    if (const std::uint32_t code = metrics.joints[joint].feedback.error_code; code != 0)
      out.sample(
          1, {{"joint", robot.joints[joint].name}, {"error", drivers::error_name(robot.joints[joint].drive, code)}});
  out.family({"takt.interventions", "takt_interventions_total", "", MetricKind::counter,
              "Ticks in which a constraint changed a joint's command, by kind."});
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
    for (std::size_t kind = 0; kind < kInterventionCount; ++kind)
      out.sample(metrics.interventions[joint][kind],
                 {{"joint", robot.joints[joint].name}, {"kind", kInterventionNames[kind]}});
}

}  // namespace

std::vector<MetricFamily> metric_families(const LiveMetrics& metrics, const config::RobotConfig& robot) {
  Families out;
  loop(out, metrics, robot);
  modes(out, metrics);
  incident(out, metrics, robot);
  contract(out, metrics, robot);
  catches(out, metrics, robot);
  buses(out, metrics, robot);
  joints(out, metrics, robot);
  return out.take();
}

}  // namespace takt::monitor
