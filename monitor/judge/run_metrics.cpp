#include "monitor/judge/run_metrics.hpp"

#include "monitor/judge/metrics_collector.hpp"

namespace takt::monitor {

std::expected<RunMetrics, std::string> metrics_of(const RecordedRun& run) {
  RunMetrics metrics;
  MetricsCollector collector(metrics);
  const auto scan = scan_run(run, {.tick = [&](const RecordedTick& tick) { collector.tick(tick.record); },
                                   .command = {},
                                   .keyframe = {},
                                   .loss = [&](const Loss& loss) { collector.loss(loss); }});
  if (!scan) return std::unexpected(scan.error());
  metrics.scan = *scan;
  collector.finish(run.robot.freshness.epsilon, run.robot.freshness.confidence);
  return metrics;
}

}  // namespace takt::monitor
