// SPDX-License-Identifier: Apache-2.0
// LiveMetrics as one table of families, from which Prometheus's text and OTLP are told. docs/metrics.md lists them.
// Pure.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "config/robot_config.hpp"
#include "monitor/telemetry/live_metrics.hpp"

namespace takt::monitor {

enum class MetricKind : std::uint8_t { gauge, counter, histogram };

struct MetricSample {
  std::vector<std::pair<std::string, std::string>> labels;  // but for the robot's
  std::variant<std::uint64_t, double, float, const Histogram*> value;
};

// `name` is OpenTelemetry's, `prometheus` Prometheus's: base unit and _total at its end. `unit`: UCUM; empty: a count
// or a state. Texts live as long as the program.
struct MetricFamily {
  std::string_view name, prometheus, unit;
  MetricKind kind;
  std::string_view help;
  std::vector<MetricSample> samples{};
};

// Histograms are those of `metrics`. A family without samples says nothing of this robot.
std::vector<MetricFamily> metric_families(const LiveMetrics& metrics, const config::RobotConfig& robot);

}  // namespace takt::monitor
