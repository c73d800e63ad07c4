// SPDX-License-Identifier: Apache-2.0
// What telling costs the control loop: how late the executive wakes and how long its tick works, with every exporter on
// (LTTng trace, OpenTelemetry files, Prometheus with a scraper, ROS 2 topics) and with none.
//
// Method: runs of the demo robot in real processes, one with and one without in turn, whose order changes from
// repetition to repetition. Latencies are those the executive recorded while the robot tracked. Figures are medians
// over the repetitions; the ratio is the median of the repetitions' own ratios.
#include <fmt/format.h>
#include <httplib.h>

#include <CLI/CLI.hpp>
#include <array>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "monitor/record/recorded_run.hpp"
#include "tests/bench/bench.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::bench {
namespace {

constexpr int kMetricsPort = 19'465;
constexpr std::uint64_t kScrapeEvery = 1000;  // ticks
constexpr char kExporters[] = "dds: { domain: 78 }\nprometheus: { port: 19465 }\notlp: {}\n";
constexpr double kAim = 1.10;  // of the wake-up's p99

struct Latencies {
  std::vector<double> wake_ns, work_ns;
};
struct Ticks {
  std::uint64_t first = 0, last = 0;
};

// A robot file of the demo with or without exporters, in a folder that goes with it.
class RobotFile {
 public:
  explicit RobotFile(bool with_exporters) {
    std::filesystem::copy("config/arm6_reach.onnx", folder_.path());
    std::ofstream file(path());
    file << test::text_of("config/arm6.yaml");
    if (with_exporters) file << kExporters;
  }
  [[nodiscard]] std::string path() const { return folder_.path("arm6.yaml"); }

 private:
  const test::TemporaryDirectory folder_;
};

// Empty when something failed, which `report` was told.
std::optional<Ticks> track(const Report& report, const test::RunningRobot& robot, bool with_exporters,
                           std::uint64_t ticks) {
  const auto failed = [&](const std::string& what) {
    report.remark(what + "\n" + robot.logs());
    return std::nullopt;
  };
  const std::string refusal = robot.arm();
  if (!refusal.empty() || !robot.wait_for_mode(Mode::tracking)) return failed("the robot does not track: " + refusal);
  if (with_exporters && !robot.takt({"trace", "start", "--output", robot.directory() + "/trace"}))
    return failed("no trace could be started (lttng-tools, or another trace runs)");
  Ticks seen;
  seen.first = robot.let_run(1);
  httplib::Client scraper("127.0.0.1", kMetricsPort);
  while (seen.last < seen.first + ticks) {
    if (with_exporters && !scraper.Get("/metrics")) return failed("/metrics does not answer");
    seen.last = robot.let_run(kScrapeEvery);
  }
  if (with_exporters && !robot.takt({"trace", "stop"})) return failed("the trace does not stop");
  return seen;
}

std::optional<Latencies> measure(const Report& report, bool with_exporters, std::uint64_t ticks) {
  const RobotFile file(with_exporters);
  test::RunningRobot robot({}, file.path());
  test::Child policy = robot.start_policy_host();
  const auto seen = track(report, robot, with_exporters, ticks);
  if (!seen) return std::nullopt;
  policy.signal(SIGTERM);
  (void)policy.wait(std::chrono::seconds(20));
  if (!robot.finish()) report.remark("a process did not end in order");
  const auto run = monitor::open_run(robot.run_directory());
  if (!run) {
    report.remark(run.error());
    return std::nullopt;
  }
  Latencies latencies;
  const auto visit = [&](const monitor::RecordedTick& recorded) {
    const TickRecordHeader& header = recorded.record.header;
    if (header.tick < seen->first || header.tick > seen->last) return;
    latencies.wake_ns.push_back(static_cast<double>(header.lateness.ns));
    latencies.work_ns.push_back(static_cast<double>(header.last_duration.ns));
  };
  (void)monitor::scan_run(*run, {.tick = visit, .command = {}, .keyframe = {}, .loss = {}});
  return latencies;
}

// One value per repetition and side: 0 without exporters, 1 with them.
struct Series {
  std::array<std::vector<double>, 2> p50, p99;
  void add(std::size_t side, const std::vector<double>& samples) {
    p50[side].push_back(percentile(samples, 0.50));
    p99[side].push_back(percentile(samples, 0.99));
  }
  void print(const Report& report, const char* what) const {
    for (std::size_t side = 0; side < 2; ++side) {
      const char* const exporters = side == 0 ? "off" : "on";
      report.figure(
          fmt::format("{:<8} exporters {:<3}  p50 {:>7.0f} ns  p99 {:>7.0f} ns", what, exporters, median(p50[side]),
                      median(p99[side])),
          {{"what", what}, {"exporters", exporters}, {"p50_ns", median(p50[side])}, {"p99_ns", median(p99[side])}});
    }
    std::array<std::vector<double>, 2> ratios;
    for (std::size_t i = 0; i < p50[0].size(); ++i) {
      ratios[0].push_back(p50[1][i] / p50[0][i]);
      ratios[1].push_back(p99[1][i] / p99[0][i]);
    }
    report.figure(
        fmt::format("{:<8} on / off       p50 {:>7.2f}     p99 {:>7.2f}", what, median(ratios[0]), median(ratios[1])),
        {{"what", what}, {"exporters", "ratio"}, {"p50", median(ratios[0])}, {"p99", median(ratios[1])}});
  }
};

int run(bool as_json, int repetitions, std::uint64_t ticks) {
  const Report report(as_json);
  Series wake, work;
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    for (const bool second : {false, true}) {
      const bool with_exporters = second != (repetition % 2 != 0);
      const auto latencies = measure(report, with_exporters, ticks);
      if (!latencies) return 1;
      wake.add(with_exporters ? 1 : 0, latencies->wake_ns);
      work.add(with_exporters ? 1 : 0, latencies->work_ns);
    }
  }
  wake.print(report, "wake-up");
  work.print(report, "tick");
  report.remark(fmt::format("aim: wake-up p99 on / off at most {:.2f}", kAim));
  return 0;
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  CLI::App app{"Cost of all exporters to a running executive. Example: takt-bench-exporters --json"};
  bool as_json = false;
  int repetitions = 5;
  std::uint64_t ticks = 8000;
  app.add_flag("--json", as_json,
               "one JSON row per figure: what, exporters (off, on, ratio), p50_ns, p99_ns or p50, p99");
  app.add_option("--repetitions", repetitions, "runs with and without, in turn")->check(CLI::Range(1, 99));
  app.add_option("--ticks", ticks, "tracked ticks per run")->check(CLI::Range(1000, 60'000));
  CLI11_PARSE(app, argc, argv);
  return takt::bench::run(as_json, repetitions, ticks);
}
