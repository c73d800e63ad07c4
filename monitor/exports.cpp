// SPDX-License-Identifier: Apache-2.0
#include "monitor/exports.hpp"

#include <spdlog/spdlog.h>

#include <utility>

#include "executive/contract/version.hpp"
#include "executive/trace/trace.hpp"

namespace takt::monitor {
namespace {

constexpr Duration kPublishPeriod = milliseconds(200);
constexpr std::uint64_t kMaxOtlpFileBytes = std::uint64_t{4} << 30U;  // of each file in each run folder

OtlpSource source_of(const RunManifest& manifest) {
  return {manifest.robot, manifest.run_id, manifest.config_sha256, std::string(version()),
          manifest.clock.monotonic_to_unix_ns};
}

}  // namespace

Exports::Exports(const config::RobotConfig& robot, const std::string& runtime_directory)
    : robot_(robot), metrics_(robot) {
  if (robot.dds) dds_.emplace(robot, runtime_directory);
  if (robot.prometheus) prometheus_.emplace(robot);
  if (robot.otlp && !robot.otlp->endpoint.empty()) otlp_sender_.emplace(robot.otlp->endpoint);
}

void Exports::begin(const RunManifest& manifest, const std::string& folder, MonoTime now) {
  began_ = now;
  metrics_.begin(manifest.run_id);
  told_catches_ = 0;
  loads_.emplace(robot_);
  monitors_.reset();
  if (robot_.policy && robot_.policy->monitors) monitors_.emplace(robot_);
  if (dds_) condenser_.emplace(robot_, manifest.clock.monotonic_to_unix_ns, now, dds_->outbox());
  begin_otlp(manifest, folder, now);
}

void Exports::go_on(const RunManifest& manifest, const std::string& folder, MonoTime now) {
  metrics_.run_id = manifest.run_id;
  if (otlp_) otlp_->finish(now);
  otlp_.reset();
  begin_otlp(manifest, folder, now);
}

void Exports::begin_otlp(const RunManifest& manifest, const std::string& folder, MonoTime now) {
  if (!robot_.otlp) return;
  auto exporter = OtlpExporter::start(robot_, source_of(manifest), folder, kMaxOtlpFileBytes,
                                      otlp_sender_ ? &*otlp_sender_ : nullptr, now);
  if (exporter)
    otlp_.emplace(std::move(*exporter));
  else
    spdlog::error("OTLP: {}; recording goes on without it", exporter.error());
}

RecordSink Exports::also_to(const RecordSink& recorded) {
  RecordSink all = recorded;
  all.command = [this, &recorded](const RecordedCommand& command) {
    recorded.command(command);
    if (monitors_) monitors_->command(command);
  };
  all.tick = [this, &recorded](const TickRecord& record) {
    recorded.tick(record);
    if (record.header.mode != record.header.previous_mode && record.header.now >= began_)
      trace::mode_changed(record.header);
    metrics_.tick(record);
    if (monitors_) monitors_->tick(record.header);
    tell_catches();
    for (const LoadMismatch& found : loads_->tick(record)) spdlog::warn("{}", sentence_of(found, robot_));
    if (condenser_) condenser_->tick(record);
    if (otlp_) otlp_->tick(record);
  };
  all.frame = [this, &recorded](const FrameRecord& frame) {
    recorded.frame(frame);
    if (otlp_) otlp_->frame(frame);
  };
  all.loss = [this, &recorded](const Loss& loss) {
    recorded.loss(loss);
    metrics_.loss(loss);
    if (otlp_) otlp_->loss(loss);
  };
  return all;
}

void Exports::tell_catches() {
  for (; monitors_ && told_catches_ < monitors_->catches().size(); ++told_catches_) {
    const PolicyCatch& caught = monitors_->catches()[told_catches_];
    metrics_.caught(caught.score);
    if (otlp_) otlp_->caught(caught.score);
    spdlog::warn("policy: tick {}: {}", caught.tick, caught.sentence);
  }
}

void Exports::recording_stopped(std::uint64_t unrecorded_ticks) {
  metrics_.recording_stopped(unrecorded_ticks);
  if (otlp_) otlp_->recording_stopped(unrecorded_ticks);
}

void Exports::drained(MonoTime now) {
  if (otlp_) otlp_->export_if_due(now);
  if (!prometheus_ || now < published_at_ + kPublishPeriod) return;
  published_at_ = now;
  prometheus_->publish(metrics_);
}

void Exports::end(MonoTime now, bool executive_ended) {
  metrics_.end();
  if (condenser_ && executive_ended) condenser_->end();
  condenser_.reset();
  if (otlp_) otlp_->finish(now);
  otlp_.reset();
  if (prometheus_) prometheus_->publish(metrics_);
}

}  // namespace takt::monitor
