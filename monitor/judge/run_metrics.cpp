#include "monitor/judge/run_metrics.hpp"

#include <algorithm>
#include <utility>

#include "monitor/judge/metrics_collector.hpp"

namespace takt::monitor {

void note(RunMetrics& metrics, Incident incident) {
  ++metrics.incident_count;
  if (metrics.incidents.size() < kListedIncidents) metrics.incidents.push_back(std::move(incident));
}

std::vector<Incident> by_gravity(std::vector<Incident> incidents) {
  std::ranges::stable_sort(incidents, {}, [](const Incident& incident) {
    return std::pair{incident.asked, incident.to != Mode::fault_latched};
  });
  return incidents;
}

std::expected<RunMetrics, std::string> metrics_of(const RecordedRun& run) {
  RunMetrics metrics;
  MetricsCollector collector(metrics);
  IncidentWatch incidents(run.robot);
  const auto scan = scan_run(run, {.tick =
                                       [&](const RecordedTick& tick) {
                                         collector.tick(tick.record);
                                         if (auto incident = incidents.tick(tick.record))
                                           note(metrics, std::move(*incident));
                                       },
                                   .command = {},
                                   .keyframe = {},
                                   .loss = [&](const Loss& loss) { collector.loss(loss); }});
  if (!scan) return std::unexpected(scan.error());
  metrics.scan = *scan;
  collector.finish(run.robot.freshness.epsilon, run.robot.freshness.confidence);
  return metrics;
}

}  // namespace takt::monitor
