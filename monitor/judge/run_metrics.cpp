// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/run_metrics.hpp"

#include <algorithm>
#include <utility>

#include "monitor/judge/metrics_collector.hpp"
#include "monitor/judge/run_end.hpp"

namespace takt::monitor {

void note(RunMetrics& metrics, incident::Incident incident) {
  ++metrics.incident_count;
  if (metrics.incidents.size() < kListedIncidents) metrics.incidents.push_back(std::move(incident));
}

void note(RunMetrics& metrics, std::span<const LoadMismatch> found) {
  for (const LoadMismatch& each : found)
    if (metrics.load_mismatches.size() < kListedLoads) metrics.load_mismatches.push_back(each);
}

void note(RunMetrics& metrics, const ChunkMonitors& monitors) {
  metrics.catches = monitors.catches();
  metrics.catch_count = monitors.catch_count();
}

std::vector<incident::Incident> by_gravity(std::vector<incident::Incident> incidents) {
  std::ranges::stable_sort(incidents, {}, [](const incident::Incident& incident) {
    return std::pair{incident.asked, incident.to != Mode::fault_latched};
  });
  return incidents;
}

std::expected<RunMetrics, std::string> metrics_of(const RecordedRun& run) {
  RunMetrics metrics;
  MetricsCollector collector(metrics);
  incident::IncidentWatch incidents(run.robot);
  ChunkMonitors monitors(run.robot);
  SensorAges sensors(run.robot);
  LoadWatch loads(run.robot);
  const auto scan = scan_run(run, {.tick =
                                       [&](const RecordedTick& tick) {
                                         collector.tick(tick.record);
                                         monitors.tick(tick.record.header);
                                         sensors.tick(tick.record.header);
                                         note(metrics, loads.tick(tick.record));
                                         if (auto incident = incidents.tick(tick.record))
                                           note(metrics, std::move(*incident));
                                       },
                                   .command = [&](const RecordedCommand& command) { monitors.command(command); },
                                   .keyframe = {},
                                   .loss = [&](const Loss& loss) { collector.loss(loss); },
                                   .policy_input = [&](const RecordedPolicyInput& input) { sensors.input(input); }});
  if (!scan) return std::unexpected(scan.error());
  metrics.scan = *scan;
  note(metrics, monitors);
  metrics.sensors = sensors.ages();
  collector.finish(run.robot.freshness.epsilon, run.robot.freshness.confidence);
  judge_end(metrics, run);
  return metrics;
}

}  // namespace takt::monitor
