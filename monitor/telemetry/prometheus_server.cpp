// SPDX-License-Identifier: Apache-2.0
#include "monitor/telemetry/prometheus_server.hpp"

#include <httplib.h>
#include <spdlog/spdlog.h>

#include <cerrno>
#include <chrono>
#include <cstring>

#include "monitor/telemetry/prometheus_text.hpp"

namespace takt::monitor {
namespace {

constexpr std::size_t kThreads = 2;  // scrapers are few
constexpr auto kLookEvery = std::chrono::milliseconds(20);
constexpr int kLooksUntilRetry = 250;
constexpr time_t kTimeout_s = 5;

}  // namespace

PrometheusServer::PrometheusServer(const config::RobotConfig& robot)
    : robot_(robot), latest_(robot), server_(std::make_unique<httplib::Server>()) {
  server_->new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
  // Not httplib's default, with which two monitors would share one port and take turns.
  server_->set_socket_options([](socket_t socket) {
    const int yes = 1;
    setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
  server_->set_read_timeout(kTimeout_s);
  server_->set_write_timeout(kTimeout_s);
  server_->Get("/metrics", [this](const httplib::Request&, httplib::Response& response) {
    response.set_content(text(), kPrometheusContentType);
  });
  thread_ = std::thread([this] {
    serve_until_stopped();
    ended_ = true;
  });
}

PrometheusServer::~PrometheusServer() {
  stop_ = true;
  while (!ended_) {  // httplib forgets a stop() that comes before it listens
    server_->stop();
    std::this_thread::sleep_for(kLookEvery);
  }
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

void PrometheusServer::serve_until_stopped() {
  const config::Prometheus& where = *robot_.prometheus;
  bool said = false;
  while (!stop_) {
    if (server_->bind_to_port(where.address, static_cast<int>(where.port))) {
      spdlog::info("Prometheus: http://{}:{}/metrics", where.address, where.port);
      server_->listen_after_bind();
      return;
    }
    if (!said)
      spdlog::error("Prometheus: {}:{} cannot be had ({}); recording goes on, trying again", where.address, where.port,
                    std::strerror(errno));
    said = true;
    for (int i = 0; i < kLooksUntilRetry && !stop_; ++i) std::this_thread::sleep_for(kLookEvery);
  }
}

}  // namespace takt::monitor
