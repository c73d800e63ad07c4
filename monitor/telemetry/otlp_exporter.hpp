// SPDX-License-Identifier: Apache-2.0
// One session's OTLP export: commands become traces, stops and faults log records, ticks metrics whose sums begin with
// the session, in files of the run folder and in requests to a receiver, as the robot file's `otlp` section says.
// Thread rule: one thread.
#pragma once

#include <expected>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/telemetry/command_traces.hpp"
#include "monitor/telemetry/live_metrics.hpp"
#include "monitor/telemetry/otlp_json.hpp"
#include "monitor/telemetry/otlp_sender.hpp"

namespace takt::monitor {

class OtlpExporter {
 public:
  // Precondition: robot.otlp; `robot` outlives it. `folder`: of the run. `sender`: none, nothing is sent; outlives the
  // exporter. Ticks before `now` are history, such as the rings hold it when the monitor attaches: nothing is told of
  // them. The error is one sentence: a file.
  static std::expected<OtlpExporter, std::string> start(const config::RobotConfig& robot, OtlpSource source,
                                                        const std::string& folder, std::uint64_t max_file_bytes,
                                                        OtlpSender* sender, MonoTime now);

  void frame(const FrameRecord& frame) { traces_->frame(frame); }
  void tick(const TickRecord& record);
  void loss(const Loss& loss) { metrics_.loss(loss); }
  void caught(config::ChunkScore score) { metrics_.caught(score); }
  void recording_stopped(std::uint64_t unrecorded_ticks) { metrics_.recording_stopped(unrecorded_ticks); }
  // What has piled up goes out when it is due.
  void export_if_due(MonoTime now);
  // Everything that is left goes out.
  void finish(MonoTime now);

 private:
  explicit OtlpExporter(const config::RobotConfig& robot) : robot_(&robot), metrics_(robot), incidents_(robot) {}
  void write(std::optional<BoundedFile>& file, OtlpSignal signal, std::string line);
  void export_traces();
  void export_metrics(MonoTime now);

  const config::RobotConfig* robot_;
  OtlpSource source_;
  LiveMetrics metrics_;  // of this session
  Duration metrics_period_;
  MonoTime since_, traces_due_, metrics_due_;
  OtlpSender* sender_ = nullptr;
  incident::IncidentWatch incidents_;
  std::optional<BoundedFile> trace_file_, metric_file_, log_file_;
  std::unique_ptr<std::vector<CommandTrace>> waiting_ = std::make_unique<std::vector<CommandTrace>>();
  std::unique_ptr<CommandTraces> traces_;
};

}  // namespace takt::monitor
