// SPDX-License-Identifier: Apache-2.0
// takt-bench-world: what a step in a world of another process costs beside that world's own work, by the ways a world
// can be had.
//
// Method: the demo arm's six joints; worlds that give back what they were told, in a process each, by takt/world.h, by
// takt.world in Python over shared memory and over its socket, and by takt-world.mjs; of those in C one gives an image
// of 640 x 480 x 3 bytes with every step, which lies there already. The figure is one WorldLink::step. They take turns;
// medians over repetitions of each repetition's p50 and p99. Nothing is pinned.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <functional>
#include <vector>

#include "executive/contract/monotonic_clock.hpp"
#include "simulation/world_link.hpp"
#include "tests/bench/bench.hpp"
#include "tests/simulation/forked_world.hpp"

namespace takt::bench {
namespace {

constexpr double kMostMicroseconds = 30.0;  // target, of C and Python over shared memory
constexpr std::size_t kJoints = 6;
constexpr config::ImageShape kImage{480, 640, 3};

struct Options {
  int repetitions = 5, steps = 5000;
  bool as_json = false;
};

struct Contender {
  const char* name;
  bool has_target;
  std::function<void(const std::string&)> run;  // in a child
  bool films = false;
  std::vector<double> p50{}, p99{};
};

void play_nothing(const std::string& path) {
  test::play(path, 0, [](const takt_world&, takt_world_state&) { return true; });
}

void film_nothing(const std::string& path) {
  const auto film = [](takt_world& world, takt_world_state& state) {
    if (state.time_ns != 0) takt_world_show(&world, 0, state.time_ns);
    return true;
  };
  test::play(path, 0, film, nullptr, 0, {{"cam0", kImage.height, kImage.width, kImage.channels, 0}});
}

void run_python(const std::string& path, const char* transport) {
  setenv("PYTHONPATH", TAKT_PYTHON_PACKAGE, 1);
  execl(TAKT_PYTHON, TAKT_PYTHON, TAKT_WORLD_PEER_PYTHON, path.c_str(), transport, nullptr);
}

void run_node(const std::string& path) {
  execlp("node", "node", TAKT_WORLD_PEER_JAVASCRIPT, path.c_str(), nullptr);
}

// False: no such world to be had here.
bool measure(Contender& contender, int steps) {
  simulation::WorldLink::Robot robot{"bench", std::vector<std::string>(kJoints, "joint"), milliseconds(1)};
  if (contender.films) robot.cameras.push_back({"cam0", kImage});
  const test::ForkedWorld process(contender.run);
  auto link = simulation::WorldLink::connect(process.path(), robot, {seconds(5), seconds(5)});
  const std::vector<double> zero(kJoints);
  if (!link || !link->reset(1, zero)) return false;
  std::vector<double> figures;
  for (int step = -100; step < steps; ++step) {
    const MonoTime before = monotonic_now();
    if (!link->step({zero, zero, zero})) return false;
    if (step >= 0) figures.push_back(1e-3 * static_cast<double>((monotonic_now() - before).ns));
  }
  contender.p50.push_back(median(figures));
  contender.p99.push_back(percentile(figures, 0.99));
  return true;
}

void report_on(const Report& report, const Contender& contender) {
  if (contender.p50.empty()) return report.remark(fmt::format("{}: not to be had here", contender.name));
  const double p50 = median(contender.p50), p99 = median(contender.p99);
  const bool reached = p50 <= kMostMicroseconds;
  const std::string target =
      contender.has_target ? fmt::format("  (p50 <= {:.0f} us: {})", kMostMicroseconds, reached ? "reached" : "MISSED")
                           : "";
  nlohmann::ordered_json row{{"bench", "world"}, {"row", contender.name}, {"p50_us", p50}, {"p99_us", p99}};
  if (contender.has_target) row.update({{"target_us", kMostMicroseconds}, {"reached", reached}});
  report.figure(fmt::format("{:<26} a step  p50 {:7.1f} us  p99 {:7.1f} us{}", contender.name, p50, p99, target), row);
}

int run(const Options& options) {
  const Report report(options.as_json);
  std::array<Contender, 5> contenders{{
      {"C, shared memory", true, play_nothing},
      {"Python, shared memory", true, [](const std::string& path) { run_python(path, "memory"); }},
      {"Python, socket", false, [](const std::string& path) { run_python(path, "socket"); }},
      {"JavaScript, socket", false, run_node},
      {"C, with an image", false, film_nothing, true},
  }};
  for (int repetition = 0; repetition < options.repetitions; ++repetition)
    for (Contender& contender : contenders)
      if (repetition == 0 || !contender.p50.empty()) measure(contender, options.steps);
  for (const Contender& contender : contenders) report_on(report, contender);
  return contenders[0].p50.empty() ? 1 : 0;
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  CLI::App app{"What a step in a world of another process costs beside that world's own work"};
  takt::bench::Options options;
  app.add_flag("--json", options.as_json, "one JSON object per figure");
  app.add_option("--repetitions", options.repetitions)->check(CLI::Range(1, 100))->capture_default_str();
  app.add_option("--steps", options.steps, "per repetition")->check(CLI::Range(100, 1'000'000))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return takt::bench::run(options);
}
