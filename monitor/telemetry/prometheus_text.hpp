// SPDX-License-Identifier: Apache-2.0
// LiveMetrics in Prometheus's text exposition format 0.0.4: base units (but for the hours of room), HELP and TYPE for
// every family, one sample per line. docs/metrics.md lists the families. Pure.
#pragma once

#include <string>

#include "config/robot_config.hpp"
#include "monitor/telemetry/live_metrics.hpp"

namespace takt::monitor {

// Content-Type of the text.
inline constexpr const char* kPrometheusContentType = "text/plain; version=0.0.4; charset=utf-8";

std::string prometheus_text(const LiveMetrics& metrics, const config::RobotConfig& robot);

}  // namespace takt::monitor
