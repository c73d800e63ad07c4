// SPDX-License-Identifier: Apache-2.0
// Running counts of what the executive does, since this was made: Prometheus scrapes those since the monitor started,
// OTLP carries those of one session.
//
// Fed with every tick record in order, over any number of sessions of the executive. Plain value: copied to be read
// elsewhere. Memory is fixed by the robot, the reaction table and the buckets, never by the running time.
// Thread rule: one thread at a time.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/chunk_score.hpp"
#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/incident/incident.hpp"
#include "monitor/judge/wire_watch.hpp"
#include "monitor/record/run_messages.hpp"

namespace takt::monitor {

// Explicit buckets: counts[i] are the values in (bounds[i - 1], bounds[i]], the last one those above all bounds.
struct Histogram {
  explicit Histogram(std::vector<Duration> upper_bounds) : bounds(std::move(upper_bounds)), counts(bounds.size() + 1) {}
  void observe(Duration value);
  std::vector<Duration> bounds;  // ascending
  std::vector<std::uint64_t> counts;
  Duration sum;
  std::uint64_t count = 0;
};

inline constexpr std::size_t kAgeStageCount = 4;  // of a command up to its first use
inline constexpr std::array<std::string_view, kAgeStageCount> kAgeStageNames{"sense", "queue", "infer", "publish"};

class LiveMetrics {
 public:
  // max_age of the robot's contract is a bucket bound of its ages, so that misses can be read off the histogram.
  explicit LiveMetrics(const config::RobotConfig& robot);

  // Another session of the executive begins: `run_id` names its run folder.
  void begin(std::string run_id);
  void tick(const TickRecord& record);
  void loss(const Loss& loss);
  void caught(config::ChunkScore score) { ++catches[static_cast<std::size_t>(score)]; }
  // The session goes on, its recording does not. `unrecorded_ticks`: of this session, so far.
  void recording_stopped(std::uint64_t unrecorded_ticks);
  void end() { running = recording = false; }
  [[nodiscard]] bool is_in(Mode mode) const { return running && newest.tick != 0 && newest.mode == mode; }

  std::string run_id;
  bool running = false;                                          // an executive runs
  bool recording = false;                                        // and its run folder is written
  double hours_left = std::numeric_limits<double>::quiet_NaN();  // of room for runs; not a number: not known
  std::uint64_t ticks = 0;
  std::uint64_t relied_ticks = 0, deadline_misses = 0;  // of the freshness contract, per tick (run_metrics.hpp)
  Histogram age;                                        // of the command in use, each tick that relied on the policy
  std::vector<Histogram> stages;                        // by stage, each command at its first use
  Histogram lateness, work;                             // of every tick
  std::vector<Histogram> tick_to_wire;                  // by bus, where its controller says when a frame left
  std::vector<std::optional<Duration>> newest_to_wire;  // of them; none: the bus has not said
  Histogram age_on_wire;                                // of the command played, by bus and tick
  std::array<std::uint64_t, kArrivalCount> arrivals{};
  std::array<std::uint64_t, kOverrunCauseCount> overruns{};
  std::uint64_t skipped_periods = 0;
  std::map<std::pair<Mode, Cause>, std::uint64_t> transitions;               // mode entered, and why; each from 0 on
  std::map<std::pair<std::string, std::string>, std::uint64_t> losses;       // ring, reason -> entries; each from 0 on
  std::vector<std::array<std::uint64_t, kInterventionCount>> interventions;  // by joint, in ticks
  std::array<std::uint64_t, config::kChunkScoreCount> catches{};             // of the chunk monitors
  std::array<std::uint64_t, kPolicyChangeCount> policy_changes{};
  std::vector<JointRecord> joints;  // newest
  TickRecordHeader newest;          // its tick; 0: none yet

  // The stop or fault that the robot stands in; null: none.
  [[nodiscard]] const incident::Incident* standing() const {
    return running && incidents_.stands() && incidents_.latest() ? &*incidents_.latest() : nullptr;
  }

 private:
  void on_wire(const TickRecordHeader& header);
  incident::IncidentWatch incidents_;
  WireWatch wire_;
  void joint_ticks(const TickRecord& record);
  std::uint64_t unrecorded_ticks_ = 0;  // of this session, that `losses` holds already
};

}  // namespace takt::monitor
