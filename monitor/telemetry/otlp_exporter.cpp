// SPDX-License-Identifier: Apache-2.0
#include "monitor/telemetry/otlp_exporter.hpp"

#include <spdlog/spdlog.h>

#include <utility>

namespace takt::monitor {
namespace {

constexpr Duration kTracePeriod = seconds(1);
constexpr std::size_t kMostTracesAtOnce = 256;

}  // namespace

std::expected<OtlpExporter, std::string> OtlpExporter::start(const config::RobotConfig& robot, OtlpSource source,
                                                             const std::string& folder, std::uint64_t max_file_bytes,
                                                             OtlpSender* sender, MonoTime now) {
  const config::Otlp& options = *robot.otlp;
  OtlpExporter exporter(robot);
  exporter.metrics_.begin(source.run_id);
  exporter.source_ = std::move(source);
  exporter.metrics_period_ = options.metrics_period;
  exporter.since_ = now;
  exporter.traces_due_ = now + kTracePeriod;
  exporter.metrics_due_ = now + options.metrics_period;
  exporter.sender_ = sender;
  exporter.traces_ = std::make_unique<CommandTraces>(
      [waiting = exporter.waiting_.get()](const CommandTrace& trace) { waiting->push_back(trace); });
  if (!options.file) return exporter;
  for (auto [file, name] :
       {std::pair{&exporter.trace_file_, "/otlp_traces.jsonl"},
        std::pair{&exporter.metric_file_, "/otlp_metrics.jsonl"}, std::pair{&exporter.log_file_, "/otlp_logs.jsonl"}}) {
    auto made = BoundedFile::create(folder + name, max_file_bytes);
    if (!made) return std::unexpected(made.error());
    file->emplace(std::move(*made));
  }
  return exporter;
}

void OtlpExporter::tick(const TickRecord& record) {
  if (record.header.now < since_) return;
  metrics_.tick(record);
  traces_->tick(record);
  if (const auto incident = incidents_.tick(record))
    write(log_file_, OtlpSignal::logs, otlp_logs(source_, std::span(&*incident, 1)));
  if (waiting_->size() >= kMostTracesAtOnce) export_traces();
}

void OtlpExporter::export_if_due(MonoTime now) {
  if (now >= traces_due_) {
    traces_due_ = now + kTracePeriod;
    export_traces();
  }
  if (now >= metrics_due_) {
    metrics_due_ = now + metrics_period_;
    export_metrics(now);
  }
}

void OtlpExporter::finish(MonoTime now) {
  metrics_.end();
  export_traces();
  export_metrics(now);
}

void OtlpExporter::export_traces() {
  if (waiting_->empty()) return;
  write(trace_file_, OtlpSignal::traces, otlp_traces(source_, *waiting_));
  waiting_->clear();
}

void OtlpExporter::export_metrics(MonoTime now) {
  write(metric_file_, OtlpSignal::metrics, otlp_metrics(source_, metric_families(metrics_, *robot_), since_, now));
}

void OtlpExporter::write(std::optional<BoundedFile>& file, OtlpSignal signal, std::string line) {
  const bool failed_before = file && !file->failure().empty();
  if (file && !file->append(line + "\n") && !failed_before)
    spdlog::error("OTLP: {}; recording goes on without it", file->failure());
  if (sender_ != nullptr) sender_->post(signal, std::move(line));
}

}  // namespace takt::monitor
