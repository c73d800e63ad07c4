// SPDX-License-Identifier: Apache-2.0
// make_dashboard_metrics FILE: what Prometheus would have scraped every 5 s from a monitor during five minutes of the
// virtual robot, as OpenMetrics text with stamps. The story: a policy that freezes for 300 ms every minute, that takes
// three times as long from the third minute on, and is gone at the end; a drive that warms up; a busy computer.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <sstream>
#include <string>

#include "monitor/record/bounded_file.hpp"
#include "monitor/telemetry/live_metrics.hpp"
#include "monitor/telemetry/prometheus_text.hpp"
#include "tests/monitor/record/virtual_robot.hpp"

namespace takt::monitor {
namespace {

constexpr std::uint64_t kTicksPerSecond = 1'000, kScrapeTicks = 5 * kTicksPerSecond, kEnd = 300 * kTicksPerSecond;
constexpr std::uint64_t kSlowFrom = 120 * kTicksPerSecond, kGoneFrom = 280 * kTicksPerSecond;
constexpr std::int64_t kUnixSeconds = 1'767'225'600;  // 2026-01-01
constexpr std::size_t kWarmJoint = 2;

// The same on every machine.
class Noise {
 public:
  double next() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state_ >> 40U) / static_cast<double>(1U << 24U);
  }

 private:
  std::uint64_t state_ = 1;
};

void spoil(pipeline::TickInput& input, std::uint64_t tick, Noise& noise) {
  const double busy = tick >= kSlowFrom ? 3 : 1;
  input.lateness = microseconds(static_cast<std::int64_t>(3 + 12 * busy * noise.next() * noise.next()));
  input.last_duration = microseconds(static_cast<std::int64_t>(60 + 40 * busy * noise.next()));
  for (std::size_t bus = 0; bus < demo_robot().buses.size(); ++bus)
    input.buses[bus].left_at =
        input.now - milliseconds(1) +
        microseconds(static_cast<std::int64_t>(380 + 60 * static_cast<double>(bus) + 90 * noise.next()));
  for (std::size_t joint = 0; joint < demo_robot().joints.size(); ++joint) {
    const double minutes = static_cast<double>(tick) / (60 * kTicksPerSecond);
    input.joints[joint].temperature_C =
        static_cast<float>(34.0 + static_cast<double>(joint) + (joint == kWarmJoint ? 6 * minutes : minutes));
  }
}

// Sample lines get the stamp; the lines about a family are said once, at its first scrape.
void append_scrape(std::string& out, const std::string& text, std::uint64_t tick) {
  const auto stamp = kUnixSeconds + static_cast<std::int64_t>(tick / kTicksPerSecond);
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    if (!line.empty() && line[0] != '#') out += fmt::format("{} {}\n", line, stamp);
}

std::string scrapes() {
  VirtualRobot robot;
  LiveMetrics metrics(demo_robot());
  metrics.begin("arm6-of-the-dashboard");
  Noise noise;
  std::string out;
  std::uint64_t tick = 0;
  robot.spoil_input = [&](pipeline::TickInput& input) { spoil(input, tick, noise); };
  for (; tick < kEnd; ++tick) {
    const std::uint64_t of_minute = tick % (60 * kTicksPerSecond);
    robot.policy_is_frozen = (of_minute >= 30'000 && of_minute < 30'300) || tick >= kGoneFrom;
    robot.answer_ticks = tick >= kSlowFrom ? 36 : 12;
    robot.run(1);
    metrics.tick(robot.latest());
    if (tick % kScrapeTicks == 0) append_scrape(out, prometheus_text(metrics, demo_robot()), tick);
  }
  return out + "# EOF\n";
}

}  // namespace
}  // namespace takt::monitor

int main(int argc, char** argv) {
  using namespace takt::monitor;
  if (argc != 2) return 64;
  try {
    if (const auto written = replace_file(argv[1], scrapes()); !written) throw std::runtime_error(written.error());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_dashboard_metrics: %s\n", error.what());
    return 1;
  }
  return 0;
}
