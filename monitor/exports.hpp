// SPDX-License-Identifier: Apache-2.0
// Everything the monitor tells besides the run folder: ROS 2, Prometheus and OpenTelemetry, each where the robot file
// has its section (`dds`, `prometheus`, `otlp`). Lives as long as the monitor; sessions of the executive begin and end.
// Nothing here makes recording wait. Thread rule: one thread.
#pragma once

#include <optional>
#include <string>

#include "config/robot_config.hpp"
#include "monitor/dds/condenser.hpp"
#include "monitor/dds/exporter.hpp"
#include "monitor/judge/chunk_monitors.hpp"
#include "monitor/judge/load_watch.hpp"
#include "monitor/record/record_stream.hpp"
#include "monitor/record/run_manifest.hpp"
#include "monitor/telemetry/live_metrics.hpp"
#include "monitor/telemetry/otlp_exporter.hpp"
#include "monitor/telemetry/otlp_sender.hpp"
#include "monitor/telemetry/prometheus_server.hpp"

namespace takt::monitor {

class Exports {
 public:
  // `robot` outlives the exports.
  Exports(const config::RobotConfig& robot, const std::string& runtime_directory);

  // Records of before `now` are history: they are counted, but no event that others act on comes of them.
  void begin(const RunManifest& manifest, const std::string& folder, MonoTime now);
  // The session goes on in another run folder.
  void go_on(const RunManifest& manifest, const std::string& folder, MonoTime now);
  // A sink that hands everything to `recorded` and here; both outlive it.
  RecordSink also_to(const RecordSink& recorded);
  // `unrecorded_ticks`: of this session, so far.
  void recording_stopped(std::uint64_t unrecorded_ticks);
  void room_left(double hours) { metrics_.hours_left = hours; }
  // After each drain of the rings.
  void drained(MonoTime now);
  void end(MonoTime now, bool executive_ended);

 private:
  void tell_catches();
  void begin_otlp(const RunManifest& manifest, const std::string& folder, MonoTime now);

  const config::RobotConfig& robot_;
  LiveMetrics metrics_;  // over all sessions
  MonoTime began_, published_at_;
  std::optional<dds::Exporter> dds_;
  std::optional<PrometheusServer> prometheus_;
  std::optional<OtlpSender> otlp_sender_;
  // of the session
  std::optional<dds::Condenser> condenser_;
  std::optional<OtlpExporter> otlp_;
  std::optional<LoadWatch> loads_;
  std::optional<ChunkMonitors> monitors_;  // none: the robot file watches for nothing
  std::size_t told_catches_ = 0;
};

}  // namespace takt::monitor
