// SPDX-License-Identifier: Apache-2.0
#include "monitor/telemetry/prometheus_text.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string_view>
#include <utility>
#include <variant>

#include "monitor/telemetry/metric_families.hpp"

namespace takt::monitor {
namespace {

constexpr std::array<std::string_view, 3> kKinds{"gauge", "counter", "histogram"};

std::string escaped(std::string_view value) {
  std::string text;
  for (const char c : value) {
    if (c == '\\' || c == '"') text += '\\';
    if (c == '\n')
      text += "\\n";
    else
      text += c;
  }
  return text;
}

// Shortest text that reads back as the same number of nanoseconds.
std::string seconds_text(Duration duration) {
  return fmt::format("{}", static_cast<double>(duration.ns) / 1e9);
}

class Exposition {
 public:
  explicit Exposition(std::string_view robot) : robot_(escaped(robot)) {}

  void write(const MetricFamily& family) {
    name_ = family.prometheus;
    text_ += fmt::format("# HELP {} {}\n# TYPE {} {}\n", name_, family.help, name_,
                         kKinds[static_cast<std::size_t>(family.kind)]);
    for (const MetricSample& sample : family.samples)
      std::visit([&](const auto& value) { write(sample, value); }, sample.value);
  }
  std::string take() { return std::move(text_); }

 private:
  template <class Number>
  void write(const MetricSample& sample, Number value) {
    const bool is_infinite = std::isinf(static_cast<double>(value));
    line("", sample, is_infinite ? "+Inf" : fmt::format("{}", value));
  }
  void write(const MetricSample& sample, const Histogram* histogram) {
    std::uint64_t below = 0;
    for (std::size_t i = 0; i < histogram->counts.size(); ++i) {
      below += histogram->counts[i];
      const std::string bound = i < histogram->bounds.size() ? seconds_text(histogram->bounds[i]) : "+Inf";
      line("_bucket", sample, fmt::format("{}", below), fmt::format(",le=\"{}\"", bound));
    }
    line("_sum", sample, seconds_text(histogram->sum));
    line("_count", sample, fmt::format("{}", histogram->count));
  }
  void line(std::string_view suffix, const MetricSample& sample, std::string_view value, std::string_view bucket = "") {
    text_ += fmt::format("{}{}{{robot=\"{}\"", name_, suffix, robot_);
    for (const auto& [key, text] : sample.labels) text_ += fmt::format(",{}=\"{}\"", key, escaped(text));
    text_ += fmt::format("{}}} {}\n", bucket, value);
  }
  std::string robot_, text_;
  std::string_view name_;
};

}  // namespace

std::string prometheus_text(const LiveMetrics& metrics, const config::RobotConfig& robot) {
  Exposition out(robot.robot);
  for (const MetricFamily& family : metric_families(metrics, robot)) out.write(family);
  return out.take();
}

}  // namespace takt::monitor
