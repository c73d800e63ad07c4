// SPDX-License-Identifier: Apache-2.0
// Everything a row says about how a rollout went, gathered tick by tick: from the tick's record, and from the truth of
// the simulated world. Thread rule: one thread at a time.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "evidence/rollout/perturbation.hpp"
#include "evidence/rollout/rollout_row.hpp"
#include "executive/contract/joints.hpp"
#include "executive/contract/tick_record.hpp"
#include "monitor/judge/metrics_collector.hpp"
#include "simulation/world_link.hpp"

namespace takt::evidence {

// What counts as done: the root mean square of the error over the last part of the rollout, and no stop that was not
// ended. A stop that the operator ended is no failure by itself; it stays counted as a safety event.
struct Score {
  MonoTime settled;             // violations of the task's constraints count from here on
  MonoTime begins;              // of the scored part; errors before it do not count
  double bound_m = 0;           // success: rms error at most this; recovered: error at most this
  bool has_to_be_done = false;  // success: the world says that the task is done
};

struct TruthOfTick {
  double error_m = 0;
  bool violated = false;  // the task's constraints
  bool lost = false;      // beyond help
};

class RolloutMeasures {
 public:
  // `disturbance` outlives this.
  RolloutMeasures(const Score& score, const Disturbance& disturbance, const config::RobotConfig& robot)
      : score_(score), disturbance_(disturbance) {
    for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
      per_rad_[joint] = config::per_rad(robot.joints[joint]);
  }
  RolloutMeasures(const RolloutMeasures&) = delete;
  RolloutMeasures& operator=(const RolloutMeasures&) = delete;

  void tick(const TickRecord& record, const TruthOfTick& truth);
  // Of a world that another process plays: nothing follows.
  void world_ended(simulation::WorldEndKind kind);
  // Fills everything but the row's identity and host fields. Call once, after the last tick.
  void finish(double epsilon, double confidence, RolloutRow& row);

 private:
  void note_failure(const TickRecordHeader& header, const TruthOfTick& truth);
  void note_arming(const TickRecordHeader& header);
  void note_recovery(const TickRecordHeader& header, double error_m);
  void add_joints(const TickRecord& record);
  void add_references(const TickRecord& record);
  void add_hash(const TickRecord& record);
  // Label of the failure; empty: none.
  [[nodiscard]] std::string_view failure(double rms_m) const;
  void fill_outcome(RolloutRow& row);

  const Score score_;
  const Disturbance& disturbance_;
  std::array<double, kMaxJoints> per_rad_{};  // what is said of all joints together is of a slide's motor
  monitor::RunMetrics metrics_;
  monitor::MetricsCollector collector_{metrics_};
  std::vector<std::int64_t> errors_nm_;  // of scored ticks
  double square_error_ = 0;              // m^2, summed over them
  std::uint64_t violations_ = 0, envelope_violations_ = 0;
  double inference_ms_ = 0;  // summed over accepted commands
  std::uint64_t accepted_ = 0;
  double energy_J_ = 0, peak_torque_Nm_ = 0;
  double torque_travel_Nm_ = 0;              // |change| from tick to tick, summed over joints and ticks
  std::array<double, kMaxJoints> torque_{};  // of the tick before
  std::array<double, kMaxJoints> velocity_{}, acceleration_{};  // of the references, of the tick before
  int played_ = 0;  // ticks in a row in which the policy was played, as far as it matters
  double peak_jerk_ = 0, peak_join_step_ = 0;
  std::string_view stop_;  // cause of the first stop since the robot last tracked; empty: none
  std::uint64_t armings_ = 0;
  std::string_view lost_;  // why the world is beyond help; empty: it is not
  bool fell_ = false;
  std::string_view spoilt_;  // how the process that played the world failed; empty: it did not
  bool done_ = false;        // as the world says
  Cause last_cause_ = Cause::none;
  MonoTime last_;
  MonoTime well_since_;         // tracking within the bound without a break since then; unset while not
  bool was_disturbed_ = false;  // left that state since the perturbation began
  bool armed_ = false;
  std::uint64_t hash_ = 0xCBF2'9CE4'8422'2325ULL;
};

}  // namespace takt::evidence
