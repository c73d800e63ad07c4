// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/run_review.hpp"

#include "evidence/review/counterfactual.hpp"
#include "monitor/judge/metrics_collector.hpp"
#include "monitor/judge/run_end.hpp"
#include "monitor/judge/script.hpp"

namespace takt::monitor {

std::expected<RunReview, std::string> review_of(const RecordedRun& run) {
  RunReview review;
  MetricsCollector collector(review.metrics);
  FaultClassifier classifier(fault_rules_of(run.robot));
  IncidentWatch incidents(run.robot);
  ChunkMonitors monitors(run.robot);
  SensorAges sensors(run.robot);
  const auto scan = scan_run(run, {.tick =
                                       [&](const RecordedTick& tick) {
                                         collector.tick(tick.record);
                                         classifier.tick(tick.record);
                                         monitors.tick(tick.record.header);
                                         sensors.tick(tick.record.header);
                                         if (auto incident = incidents.tick(tick.record))
                                           note(review.metrics, std::move(*incident));
                                       },
                                   .command =
                                       [&](const RecordedCommand& command) {
                                         classifier.command(command);
                                         monitors.command(command);
                                       },
                                   .keyframe = {},
                                   .loss = [&](const Loss& loss) { collector.loss(loss); },
                                   .policy_input =
                                       [&](const RecordedPolicyInput& input) {
                                         sensors.input(input);
                                         classifier.input(input);
                                       },
                                   .image = [&](const ShownImage& image) { classifier.image(image); }});
  if (!scan) return std::unexpected(scan.error());
  review.metrics.scan = *scan;
  note(review.metrics, monitors);
  review.metrics.sensors = sensors.ages();
  collector.finish(run.robot.freshness.epsilon, run.robot.freshness.confidence);
  review.faults = classifier.finish();
  add_counterfactuals(review.metrics.incidents, run);
  judge_end(review.metrics, run);
  Script(read_run_events(run.folder), run.robot).explain(review.faults);
  return review;
}

}  // namespace takt::monitor
