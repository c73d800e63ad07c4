// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/rollout_measures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

namespace takt::evidence {
namespace {

AgeQuantiles row_of(const monitor::Quantiles& ns) {
  if (ns.count == 0) return {};
  return {ns.p50 * 1e-6, ns.p95 * 1e-6, ns.p99 * 1e-6};
}

AgeRow row_of(const std::array<monitor::Quantiles, monitor::kAgePartCount>& parts) {
  return {.total = row_of(parts[5]),
          .sense = row_of(parts[0]),
          .queue = row_of(parts[1]),
          .infer = row_of(parts[2]),
          .publish = row_of(parts[3]),
          .hold = row_of(parts[4])};
}

MissRow row_of(const monitor::MissRate& misses) {
  return {misses.misses, misses.count, misses.rate, misses.effective_count, misses.upper_bound};
}

std::uint64_t entered(const monitor::RunMetrics& metrics, Mode mode) {
  return static_cast<std::uint64_t>(
      std::ranges::count(metrics.transitions, mode, [](const monitor::Transition& one) { return one.to; }));
}

// What fails a rollout that its world ended, for rows.
std::string_view label_of(simulation::WorldEndKind kind) {
  switch (kind) {
    case simulation::WorldEndKind::absent:
      return "world_absent";
    case simulation::WorldEndKind::refused:
      return "world_refused";
    case simulation::WorldEndKind::hung:
      return "world_hung";
    case simulation::WorldEndKind::died:
      return "world_died";
    case simulation::WorldEndKind::invalid_answer:
      return "world_nonsense";
    case simulation::WorldEndKind::unable:
      return "world_unable";
    case simulation::WorldEndKind::failed:
      return "failed";
    case simulation::WorldEndKind::succeeded:
      return {};
  }
  return "world_nonsense";
}

bool is_latched(Mode mode) {
  return mode == Mode::damped_stop || mode == Mode::fault_latched;
}

}  // namespace

void RolloutMeasures::tick(const TickRecord& record, const TruthOfTick& truth) {
  const TickRecordHeader& header = record.header;
  collector_.tick(record);
  add_hash(record);
  add_joints(record);
  add_references(record);
  if (is_first_use(header)) {
    ++accepted_;
    inference_ms_ += header.age.infer.milliseconds();
  }
  note_failure(header, truth);
  note_arming(header);
  note_recovery(header, truth.error_m);
  if ((header.causes_active >> static_cast<unsigned>(Cause::envelope_exceeded) & 1U) != 0) ++envelope_violations_;
  if (header.now >= score_.begins) {
    errors_nm_.push_back(std::llround(truth.error_m * 1e9));
    square_error_ += truth.error_m * truth.error_m;
  }
  if (header.now >= score_.settled && truth.violated) ++violations_;
  last_ = header.now;
}

void RolloutMeasures::world_ended(simulation::WorldEndKind kind) {
  done_ = kind == simulation::WorldEndKind::succeeded;
  if (kind == simulation::WorldEndKind::failed)
    lost_ = stop_.empty() ? label_of(kind) : stop_;
  else
    spoilt_ = label_of(kind);
}

void RolloutMeasures::note_failure(const TickRecordHeader& header, const TruthOfTick& truth) {
  if (header.cause != Cause::none) last_cause_ = header.cause;
  fell_ |= truth.lost;
  if (truth.lost && lost_.empty()) lost_ = stop_.empty() ? "fell" : stop_;
  if (stop_.empty() && is_latched(header.mode) && header.mode != header.previous_mode) stop_ = name(header.cause);
}

void RolloutMeasures::note_arming(const TickRecordHeader& header) {
  if (header.cause == Cause::operator_arm) ++armings_;
  if (header.mode != Mode::tracking) return;
  if (armings_ == 0) armings_ = 1;  // a recording may begin with an armed robot
  armed_ = true;
  stop_ = {};
}

void RolloutMeasures::note_recovery(const TickRecordHeader& header, double error_m) {
  const bool well = header.mode == Mode::tracking && error_m <= score_.bound_m;
  if (!well) {
    well_since_ = {};
    was_disturbed_ |= header.now >= disturbance_.begins();
  } else if (!well_since_.is_set()) {
    well_since_ = header.now;
  }
}

void RolloutMeasures::add_joints(const TickRecord& record) {
  const double dt = last_.is_set() ? (record.header.now - last_).seconds() : 0;
  for (std::size_t joint = 0; joint < record.header.joint_count; ++joint) {
    const JointFeedback& feedback = record.joints[joint].feedback;
    energy_J_ += std::abs(static_cast<double>(feedback.tau) * static_cast<double>(feedback.dq)) * dt;
    const double torque = static_cast<double>(feedback.tau) * per_rad_[joint];
    if (last_.is_set()) torque_travel_Nm_ += std::abs(torque - torque_[joint]);
    torque_[joint] = torque;
    peak_torque_Nm_ = std::max(peak_torque_Nm_, std::abs(torque));
  }
}

// A step needs one tick before it, a jerk two.
void RolloutMeasures::add_references(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  const double dt = last_.is_set() ? (header.now - last_).seconds() : 0;
  if (header.mode != Mode::tracking || dt <= 0) {
    played_ = 0;
    return;
  }
  for (std::size_t joint = 0; joint < header.joint_count; ++joint) {
    const double velocity = static_cast<double>(record.joints[joint].dq_reference) / per_rad_[joint];
    const double step = velocity - std::exchange(velocity_[joint], velocity);
    const double acceleration = step / dt;
    const double jerk = (acceleration - std::exchange(acceleration_[joint], acceleration)) / dt;
    if (played_ >= 1 && is_first_use(header)) peak_join_step_ = std::max(peak_join_step_, std::abs(step));
    if (played_ >= 2) peak_jerk_ = std::max(peak_jerk_, std::abs(jerk));
  }
  played_ = std::min(played_ + 1, 2);
}

// FNV-1a over words instead of bytes, with a rotation so that high bits reach low ones. Records are whole words.
void RolloutMeasures::add_hash(const TickRecord& record) {
  static_assert(sizeof(TickRecordHeader) % 8 == 0 && sizeof(JointRecord) % 8 == 0);
  const auto* const bytes = reinterpret_cast<const unsigned char*>(&record);
  for (std::size_t at = 0; at < record.used_bytes(); at += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes + at, sizeof word);
    hash_ = std::rotl((hash_ ^ word) * 0x0000'0100'0000'01B3ULL, 29);
  }
}

std::string_view RolloutMeasures::failure(double rms_m) const {
  if (!spoilt_.empty()) return spoilt_;  // says nothing of the robot
  if (!lost_.empty()) return lost_;
  if (!stop_.empty()) return stop_;
  if (!armed_) return "not_armed";
  if (done_) return "";
  if (score_.has_to_be_done) return "not_done";
  return rms_m > score_.bound_m ? "tracking_error" : "";
}

void RolloutMeasures::fill_outcome(RolloutRow& row) {
  const auto scored = static_cast<double>(errors_nm_.size());
  row.tracking_error_rms_m = scored > 0 ? std::sqrt(square_error_ / scored) : 0;
  row.tracking_error_p95_m = std::max(0.0, monitor::quantiles_of(errors_nm_).p95 * 1e-9);
  row.constraint_violations = violations_;
  row.failure_label = failure(row.tracking_error_rms_m);
  row.success = row.failure_label.empty();
  row.rearms = armings_ > 0 ? armings_ - 1 : 0;
  row.fell = fell_;
  row.final_mode = metrics_.last_mode;
  row.final_cause = last_cause_;
  const bool recovered = was_disturbed_ && well_since_.is_set();
  if (!disturbance_.has(Trouble::none) && recovered)
    row.recovery_s = std::max(0.0, (well_since_ - disturbance_.ends()).seconds());
}

void RolloutMeasures::finish(double epsilon, double confidence, RolloutRow& row) {
  collector_.finish(epsilon, confidence);
  fill_outcome(row);
  row.ticks = metrics_.ticks;
  if (accepted_ != 0) row.inference_mean_ms = inference_ms_ / static_cast<double>(accepted_);
  row.age_per_command = row_of(metrics_.age_per_command);
  row.age_per_tick = row_of(metrics_.age_per_tick);
  row.misses_per_command = row_of(metrics_.misses_per_command);
  row.misses_per_tick = row_of(metrics_.misses_per_tick);
  row.safety = {entered(metrics_, Mode::degraded), entered(metrics_, Mode::damped_stop),
                entered(metrics_, Mode::fault_latched), envelope_violations_};
  row.interventions = metrics_.interventions;
  for (std::size_t mode = 0; mode < kModeCount && metrics_.ticks != 0; ++mode)
    row.mode_share[mode] = static_cast<double>(metrics_.ticks_in_mode[mode]) / static_cast<double>(metrics_.ticks);
  row.energy_J = energy_J_;
  row.peak_torque_Nm = peak_torque_Nm_;
  const double span_s = metrics_.span.seconds();
  row.torque_rate_Nm_s = span_s > 0 ? torque_travel_Nm_ / span_s : 0;
  row.peak_reference_jerk = peak_jerk_;
  row.peak_join_velocity_step = peak_join_step_;
  row.replay_hash = fmt::format("{:016x}", hash_);
}

}  // namespace takt::evidence
