// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/run_review.hpp"

#include "evidence/review/counterfactual.hpp"
#include "monitor/judge/metrics_collector.hpp"
#include "monitor/judge/run_end.hpp"
#include "monitor/judge/script.hpp"

namespace takt::evidence {

std::expected<RunReview, std::string> review_of(const monitor::RecordedRun& run) {
  RunReview review;
  monitor::MetricsCollector collector(review.metrics);
  monitor::FaultClassifier classifier(monitor::fault_rules_of(run.robot));
  incident::IncidentWatch incidents(run.robot);
  monitor::ChunkMonitors monitors(run.robot);
  monitor::SensorAges sensors(run.robot);
  monitor::LoadWatch loads(run.robot);
  const auto scan =
      monitor::scan_run(run, {.tick =
                                  [&](const monitor::RecordedTick& tick) {
                                    collector.tick(tick.record);
                                    classifier.tick(tick.record);
                                    monitors.tick(tick.record.header);
                                    sensors.tick(tick.record.header);
                                    monitor::note(review.metrics, loads.tick(tick.record));
                                    if (auto incident = incidents.tick(tick.record))
                                      monitor::note(review.metrics, std::move(*incident));
                                  },
                              .command =
                                  [&](const monitor::RecordedCommand& command) {
                                    classifier.command(command);
                                    monitors.command(command);
                                  },
                              .keyframe = {},
                              .loss = [&](const monitor::Loss& loss) { collector.loss(loss); },
                              .policy_input =
                                  [&](const monitor::RecordedPolicyInput& input) {
                                    sensors.input(input);
                                    classifier.input(input);
                                  },
                              .image = [&](const monitor::ShownImage& image) { classifier.image(image); }});
  if (!scan) return std::unexpected(scan.error());
  review.metrics.scan = *scan;
  monitor::note(review.metrics, monitors);
  review.metrics.sensors = sensors.ages();
  collector.finish(run.robot.freshness.epsilon, run.robot.freshness.confidence);
  review.faults = classifier.finish();
  add_counterfactuals(review.metrics.incidents, run);
  monitor::judge_end(review.metrics, run);
  monitor::Script(monitor::read_run_events(run.folder), run.robot).explain(review.faults);
  return review;
}

}  // namespace takt::evidence
