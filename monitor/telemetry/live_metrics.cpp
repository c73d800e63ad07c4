// SPDX-License-Identifier: Apache-2.0
#include "monitor/telemetry/live_metrics.hpp"

#include <algorithm>

#include "executive/contract/tick_facts.hpp"
#include "monitor/record/image_message.hpp"

namespace takt::monitor {
namespace {

template <std::size_t size, class Enum>
void count(std::array<std::uint64_t, size>& counts, Enum value) {
  if (const auto index = static_cast<std::size_t>(value); index < size) ++counts[index];
}

std::vector<Duration> age_bounds(Duration max_age) {
  std::vector<Duration> bounds;
  for (const int ms : {1, 2, 5, 10, 20, 30, 50, 75, 100, 150, 200, 300, 500, 1000, 2000, 5000})
    bounds.push_back(milliseconds(ms));
  const auto at = std::ranges::lower_bound(bounds, max_age);
  if (at == bounds.end() || *at != max_age) bounds.insert(at, max_age);
  return bounds;
}

std::vector<Duration> loop_bounds() {
  std::vector<Duration> bounds;
  for (const int us : {5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10'000, 50'000})
    bounds.push_back(microseconds(us));
  return bounds;
}

}  // namespace

void Histogram::observe(Duration value) {
  const auto at = std::ranges::lower_bound(bounds, value);
  ++counts[static_cast<std::size_t>(at - bounds.begin())];
  sum = sum + value;
  ++count;
}

LiveMetrics::LiveMetrics(const config::RobotConfig& robot)
    : age(age_bounds(robot.freshness.max_age)),
      stages(kAgeStageCount, Histogram(age_bounds(robot.freshness.max_age))),
      lateness(loop_bounds()),
      work(loop_bounds()),
      tick_to_wire(robot.buses.size(), Histogram(loop_bounds())),
      newest_to_wire(robot.buses.size()),
      age_on_wire(age_bounds(robot.freshness.max_age)),
      interventions(robot.joints.size()),
      joints(robot.joints.size()),
      incidents_(robot) {
  for (const auto& change : incident::possible_transitions()) transitions[change] = 0;
  for (const std::string_view ring : kRingNames) {
    for (const std::string_view reason : kRingLossReasons) losses[{std::string(ring), std::string(reason)}] = 0;
    if (ring.ends_with("_input")) losses[{std::string(ring), std::string(kTooMany)}] = 0;
  }
  losses[{"tick", std::string(kRecordingStopped)}] = 0;
  for (const std::string_view reason : kImageFileNames)
    if (reason != name(ImageFile::stored)) losses[{std::string(kImageLoss), std::string(reason)}] = 0;
}

void LiveMetrics::begin(std::string id) {
  run_id = std::move(id);
  running = recording = true;
  newest = {};
  wire_ = {};
  unrecorded_ticks_ = 0;
}

void LiveMetrics::tick(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  if (header.joint_count != joints.size()) return;
  ++ticks;
  incidents_.tick(record);
  lateness.observe(header.lateness);
  work.observe(header.last_duration);
  on_wire(header);
  count(arrivals, header.seats[Seat::policy].arrival);
  count(overruns, header.overrun_cause);
  count(policy_changes, header.candidate.change);
  if (newest.tick != 0) skipped_periods += header.skipped_periods - newest.skipped_periods;
  if (header.mode != header.previous_mode) ++transitions[{header.mode, header.cause}];
  if (relies_on_policy(header)) {
    ++relied_ticks;
    if (!is_usable(header.seats[Seat::policy].freshness)) ++deadline_misses;
    if (header.seats[Seat::policy].freshness != Freshness::missing) age.observe(header.age.total());
  }
  if (is_first_use(header)) {
    const std::array<Duration, kAgeStageCount> parts{header.age.sense, header.age.queue, header.age.infer,
                                                     header.age.publish};
    for (std::size_t stage = 0; stage < kAgeStageCount; ++stage) stages[stage].observe(parts[stage]);
  }
  joint_ticks(record);
  newest = header;
}

void LiveMetrics::on_wire(const TickRecordHeader& header) {
  const WireWatch::PerBus buses = wire_.take(header);
  for (std::size_t bus = 0; bus < tick_to_wire.size(); ++bus) {
    if (!buses[bus]) continue;
    tick_to_wire[bus].observe(buses[bus]->since_tick);
    newest_to_wire[bus] = buses[bus]->since_tick;
    if (buses[bus]->age) age_on_wire.observe(*buses[bus]->age);
  }
}

void LiveMetrics::joint_ticks(const TickRecord& record) {
  for (std::size_t joint = 0; joint < joints.size(); ++joint) {
    joints[joint] = record.joints[joint];
    for (std::size_t kind = 0; kind < kInterventionCount; ++kind)
      interventions[joint][kind] += (record.joints[joint].interventions >> kind) & 1U;
  }
}

void LiveMetrics::loss(const Loss& loss) {
  losses[{loss.ring, loss.reason}] += loss.count;
}

void LiveMetrics::recording_stopped(std::uint64_t unrecorded_ticks) {
  recording = false;
  losses[{"tick", std::string(kRecordingStopped)}] += unrecorded_ticks - unrecorded_ticks_;
  unrecorded_ticks_ = unrecorded_ticks;
}

}  // namespace takt::monitor
