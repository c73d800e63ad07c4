#include "monitor/run_metrics.hpp"

#include "monitor/metrics_collector.hpp"

namespace takt::monitor {

std::expected<RunMetrics, std::string> metrics_of(const RecordedRun& run) {
  RunMetrics metrics;
  MetricsCollector collector(metrics);
  const auto report =
      scan_run(run, {.tick = [&](const RecordedTick& tick) { collector.tick(tick.record); },
                     .command = {},
                     .keyframe = {},
                     .loss = [&](const Loss& loss) { metrics.losses[loss.ring + " " + loss.reason] += loss.count; }});
  if (!report) return std::unexpected(report.error());
  metrics.file = report->file;
  if (metrics.ticks != 0) collector.finish(run.robot.freshness.epsilon, run.robot.freshness.confidence);
  return metrics;
}

}  // namespace takt::monitor
