// SPDX-License-Identifier: Apache-2.0
#include "monitor/telemetry/prometheus_server.hpp"

#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>

#include "monitor/telemetry/prometheus_text.hpp"
#include "monitor/telemetry/scrape_server.hpp"

namespace takt::monitor {
namespace {

constexpr int kRetry_ms = 5000;

}  // namespace

PrometheusServer::PrometheusServer(const config::RobotConfig& robot)
    : robot_(robot), latest_(robot), stop_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  thread_ = std::thread([this] { serve_until_stopped(); });
}

PrometheusServer::~PrometheusServer() {
  (void)eventfd_write(stop_.get(), 1);
  thread_.join();
}

void PrometheusServer::publish(const LiveMetrics& metrics) {
  const std::lock_guard lock(mutex_);
  latest_ = metrics;
}

std::string PrometheusServer::text() const {
  const LiveMetrics metrics = [this] {
    const std::lock_guard lock(mutex_);
    return latest_;
  }();
  return prometheus_text(metrics, robot_);
}

bool PrometheusServer::stops_within(int milliseconds) const {
  pollfd looked{stop_.get(), POLLIN, 0};
  return poll(&looked, 1, milliseconds) > 0;
}

void PrometheusServer::serve_until_stopped() {
  const config::Prometheus& where = *robot_.prometheus;
  bool said = false;
  do {
    auto server = ScrapeServer::listen(where.address, static_cast<std::uint16_t>(where.port), "/metrics",
                                       kPrometheusContentType, [this] { return text(); });
    if (server) {
      spdlog::info("Prometheus: http://{}:{}/metrics", where.address, where.port);
      return server->serve(stop_);
    }
    if (!said)
      spdlog::error("Prometheus: {}:{} cannot be had ({}); recording goes on, trying again", where.address, where.port,
                    server.error());
    said = true;
  } while (!stops_within(kRetry_ms));
}

}  // namespace takt::monitor
