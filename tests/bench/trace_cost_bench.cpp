// SPDX-License-Identifier: Apache-2.0
// What tracing costs the executive's tick: work per tick and wake-up latency with an LTTng session on and off, in one
// run of a real robot.
//
// Method: executive, plant, policy host and monitor as real processes; once the robot tracks, `takt trace start` and
// `takt trace stop` alternate. A tick counts as traced when it is in the trace, and as untraced when it is at least
// kMargin ticks away from one that is. Its work is what the executive itself measured (last_duration of the next
// record: wake-up to the end of the bus write, the records and the trace points). Figures are medians over the
// repetitions, each of which has both.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <string>
#include <vector>

#include "lab/trace/trace_reader.hpp"
#include "monitor/record/recorded_run.hpp"
#include "tests/bench/bench.hpp"
#include "tests/process/running_robot.hpp"

namespace takt::bench {
namespace {

constexpr std::uint64_t kMargin = 300;

struct TickCost {
  double work_ns = 0, lateness_ns = 0;
};
// Ticks of one repetition, both ends included.
struct Phase {
  std::uint64_t first = 0, last = 0;
  std::string trace;
};

// By tick number: its cost; work is unknown (negative) for the last tick and before a gap.
std::vector<TickCost> costs_of(const monitor::RecordedRun& run) {
  std::vector<TickCost> costs;
  const auto visit = [&costs](const monitor::RecordedTick& recorded) {
    const TickRecordHeader& header = recorded.record.header;
    if (header.tick >= costs.size()) costs.resize(header.tick + 1, {-1, 0});
    costs[header.tick].lateness_ns = static_cast<double>(header.lateness.ns);
    if (header.tick != 0) costs[header.tick - 1].work_ns = static_cast<double>(header.last_duration.ns);
  };
  (void)monitor::scan_run(run, {.tick = visit, .command = {}, .keyframe = {}, .loss = {}});
  return costs;
}

// Marks the trace's ticks, and those near them, which count for neither side.
bool mark(const std::string& trace, std::vector<bool>& traced, std::vector<bool>& near) {
  const auto visit = [&](const lab::TraceEvent& event) {
    if (event.name != lab::EventName::tick_end || event.tick >= traced.size()) return;
    traced[event.tick] = true;
    const std::uint64_t to = std::min<std::uint64_t>(event.tick + kMargin, near.size() - 1);
    if (near[to] && event.tick > kMargin && near[event.tick - kMargin]) return;
    for (std::uint64_t tick = event.tick - std::min(event.tick, kMargin); tick <= to; ++tick) near[tick] = true;
  };
  return lab::read_trace(trace, visit).has_value();
}

struct Series {
  std::vector<double> p50[2], p99[2];  // [untraced, traced], one value per repetition
  void add(const std::vector<double>& untraced, const std::vector<double>& traced) {
    for (std::size_t side = 0; side < 2; ++side) {
      p50[side].push_back(percentile(side == 0 ? untraced : traced, 0.50));
      p99[side].push_back(percentile(side == 0 ? untraced : traced, 0.99));
    }
  }
  void print(const Report& report, const char* what) const {
    std::vector<double> extra;
    for (std::size_t i = 0; i < p50[0].size(); ++i) extra.push_back(p50[1][i] - p50[0][i]);
    for (std::size_t side = 0; side < 2; ++side) {
      const char* const tracing = side == 0 ? "off" : "on";
      report.figure(
          fmt::format("{:<10} tracing {:<3}   p50 {:>7.0f} ns   p99 {:>7.0f} ns", what, tracing, median(p50[side]),
                      median(p99[side])),
          {{"what", what}, {"tracing", tracing}, {"p50_ns", median(p50[side])}, {"p99_ns", median(p99[side])}});
    }
    report.figure(fmt::format("{:<10} extra         p50 {:>7.0f} ns", what, median(extra)),
                  {{"what", what}, {"tracing", "extra"}, {"p50_ns", median(extra)}});
  }
};

struct Sides {
  std::vector<double> work[2], lateness[2];
};

Sides sides_of(const Phase& phase, const std::vector<TickCost>& costs, const std::vector<bool>& traced,
               const std::vector<bool>& near) {
  Sides sides;
  for (std::uint64_t tick = phase.first; tick <= phase.last && tick < costs.size(); ++tick) {
    if (costs[tick].work_ns < 0 || (near[tick] && !traced[tick])) continue;
    sides.work[traced[tick] ? 1 : 0].push_back(costs[tick].work_ns);
    sides.lateness[traced[tick] ? 1 : 0].push_back(costs[tick].lateness_ns);
  }
  return sides;
}

int evaluate(const Report& report, const test::RunningRobot& robot, const std::vector<Phase>& phases) {
  const auto run = monitor::open_run(robot.run_directory());
  if (!run) {
    report.remark(run.error());
    return 1;
  }
  const std::vector<TickCost> costs = costs_of(*run);
  std::vector<bool> traced(costs.size()), near(costs.size());
  for (const Phase& phase : phases) {
    if (!mark(phase.trace, traced, near)) {
      report.remark("no trace in " + phase.trace);
      return 1;
    }
  }
  Series work, lateness;
  for (const Phase& phase : phases) {
    const Sides sides = sides_of(phase, costs, traced, near);
    if (sides.work[0].empty() || sides.work[1].empty()) {
      report.remark("a repetition has no traced or no untraced ticks: did the processes join the trace?");
      return 1;
    }
    work.add(sides.work[0], sides.work[1]);
    lateness.add(sides.lateness[0], sides.lateness[1]);
  }
  work.print(report, "tick");
  lateness.print(report, "wake-up");
  return 0;
}

int run(bool as_json, int repetitions, std::uint64_t ticks) {
  const Report report(as_json);
  test::RunningRobot robot;
  test::Child policy = robot.start_policy_host();
  const std::string refusal = robot.arm();
  if (!refusal.empty() || !robot.wait_for_mode(Mode::tracking)) {
    report.remark("the robot does not track: " + refusal + "\n" + robot.logs());
    return 1;
  }
  std::vector<Phase> phases;
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    Phase phase;
    phase.first = robot.let_run(ticks) - ticks;
    phase.trace = robot.directory() + "/trace" + std::to_string(repetition);
    if (!robot.takt({"trace", "start", "--output", phase.trace})) {
      report.remark("no trace could be started (lttng-tools, or another trace runs):\n" + robot.logs());
      return 1;
    }
    robot.let_run(ticks);
    if (!robot.takt({"trace", "stop"})) return 1;
    phase.last = robot.status().value_or(OperatorReply{}).status.ticks;
    phases.push_back(std::move(phase));
  }
  policy.signal(SIGTERM);
  (void)policy.wait(std::chrono::seconds(20));
  if (!robot.finish()) report.remark("a process did not end in order");
  return evaluate(report, robot, phases);
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  CLI::App app{"Cost of tracing to the tick of a running executive. Example: takt-bench-trace-cost --json"};
  bool as_json = false;
  int repetitions = 5;
  std::uint64_t ticks = 3000;
  app.add_flag("--json", as_json, "one JSON row per figure: what, tracing (off, on, extra), p50_ns, p99_ns");
  app.add_option("--repetitions", repetitions, "tracing off and on in turn; figures are medians")
      ->check(CLI::Range(1, 99));
  app.add_option("--ticks", ticks, "ticks per repetition and side")->check(CLI::Range(1000, 60'000));
  CLI11_PARSE(app, argc, argv);
  return takt::bench::run(as_json, repetitions, ticks);
}
