// SPDX-License-Identifier: Apache-2.0
// Serves LiveMetrics to Prometheus: GET /metrics over HTTP at the address of the robot file's `prometheus` section.
//
// One thread of its own; the recording thread only hands over a copy now and then. A port that cannot be had is said
// once and tried again every few seconds: recording never depends on it. A peer can spend little: 16 connections, 8 KiB
// of request, no body, 5 s from the first byte to the last. Where all connections are taken, the oldest that has not
// said its request makes room. Each connection answers one request.
// Thread rule: construct, publish() and destroy on one thread.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "config/robot_config.hpp"
#include "executive/ipc/descriptor.hpp"
#include "monitor/telemetry/live_metrics.hpp"

namespace takt::monitor {

class PrometheusServer {
 public:
  // Precondition: robot.prometheus. `robot` outlives the server.
  explicit PrometheusServer(const config::RobotConfig& robot);
  ~PrometheusServer();
  PrometheusServer(const PrometheusServer&) = delete;
  PrometheusServer& operator=(const PrometheusServer&) = delete;

  void publish(const LiveMetrics& metrics);

 private:
  void serve_until_stopped();
  [[nodiscard]] bool stops_within(int milliseconds) const;
  [[nodiscard]] std::string text() const;

  const config::RobotConfig& robot_;
  mutable std::mutex mutex_;
  LiveMetrics latest_;    // guarded
  ipc::Descriptor stop_;  // an event: readable from the end on
  std::thread thread_;    // last: everything else is there when it starts
};

}  // namespace takt::monitor
