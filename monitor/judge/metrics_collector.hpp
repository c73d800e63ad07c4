// SPDX-License-Identifier: Apache-2.0
// Tick records in, RunMetrics out: the one place where a run's numbers are computed, for recorded runs and for rollouts
// in virtual time alike. What they mean: run_metrics.hpp. Keeps every age in memory. Thread rule: one thread at a time.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "executive/contract/tick_record.hpp"
#include "monitor/judge/run_metrics.hpp"
#include "monitor/judge/wire_watch.hpp"

namespace takt::monitor {

class MetricsCollector {
 public:
  // `metrics` outlives this.
  explicit MetricsCollector(RunMetrics& metrics) : metrics_(metrics) {}

  void tick(const TickRecord& record);
  void loss(const Loss& loss);
  // Call once.
  void finish(double epsilon, double confidence);

 private:
  using Samples = std::array<std::vector<std::int64_t>, kAgePartCount>;

  void interventions(InterventionMask mask);
  void transition(const TickRecordHeader& header);
  void mark(const TickRecordHeader& header);
  void relied(const TickRecordHeader& header);
  void on_wire(const TickRecordHeader& header);
  void command(const TickRecordHeader& header);
  void candidate(const TickRecordHeader& header);

  RunMetrics& metrics_;
  TickRecordHeader first_, last_;
  Samples per_tick_, per_command_;
  std::vector<std::int64_t> lateness_, work_;
  WireWatch wire_;
  std::array<std::vector<std::int64_t>, kMaxBuses> tick_to_wire_;
  std::vector<std::int64_t> age_on_wire_;
  std::vector<std::int64_t> candidate_age_, candidate_distance_;
  std::vector<std::int64_t> commands_;  // in the order they were judged: age at first use, kMissed if one missed
  std::uint64_t tick_misses_ = 0;
  std::uint64_t standby_gaps_ = 0;  // ticks missing between two of standby: only these can have been left out as quiet
  std::pair<std::uint8_t, std::uint64_t> in_use_{};  // session and sequence
  std::size_t in_use_at_ = 0;                        // of commands_
};

}  // namespace takt::monitor
