// SPDX-License-Identifier: Apache-2.0
// Serves LiveMetrics to Prometheus: GET /metrics over HTTP at the address of the robot file's `prometheus` section.
//
// Runs on threads of its own; the recording thread only hands over a copy now and then. A port that cannot be had is
// said once and tried again every few seconds: recording never depends on it.
// Thread rule: construct, publish() and destroy on one thread.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "config/robot_config.hpp"
#include "monitor/telemetry/live_metrics.hpp"

namespace httplib {
class Server;
}

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
  [[nodiscard]] std::string text() const;

  const config::RobotConfig& robot_;
  mutable std::mutex mutex_;
  LiveMetrics latest_;  // guarded
  std::unique_ptr<httplib::Server> server_;
  std::atomic<bool> stop_ = false, ended_ = false;
  std::thread thread_;  // last: everything else is there when it starts
};

}  // namespace takt::monitor
