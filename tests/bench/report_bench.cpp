// SPDX-License-Identifier: Apache-2.0
// What the report of a long run costs: an hour of the virtual robot, with encoder noise, varying ages and a stall of
// the policy every minute, recorded by the real recorder; then `takt report` on it, and the page opened in Chromium.
//
// Figures: seconds and peak memory of `takt report`, weight of the page, and ms from navigation until every chart is
// drawn, until a jump to a violation is, and until the whole run is again (medians of five openings).
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cstdio>
#include <filesystem>
#include <random>

#include "tests/bench/bench.hpp"
#include "tests/bench/lively_robot.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::bench {
namespace {

namespace fs = std::filesystem;
constexpr double kWeightTarget = 15.0;   // MB
constexpr double kOpenTarget = 3'000.0;  // ms
constexpr std::uint64_t kStallEvery = 60'000, kStallTicks = 300;

void record_long_run(const std::string& directory, std::uint64_t ticks) {
  std::mt19937_64 random(1);
  monitor::VirtualRobot robot;
  make_lively(robot, random);
  (void)monitor::record(robot, directory, ticks, [&](std::uint64_t tick) {
    robot.policy_is_frozen = tick % kStallEvery >= kStallEvery - kStallTicks;
  });
}

struct Cost {
  bool done = false;
  double seconds = 0, cpu_seconds = 0, peak_MiB = 0;
};

double seconds_of(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

Cost cost_of_report(const std::string& directory) {
  const std::string takt = fs::read_symlink("/proc/self/exe").parent_path() / "takt";
  const std::int64_t begin = ticks();
  const pid_t pid = fork();
  if (pid == 0) {
    if (std::freopen("/dev/null", "w", stdout) == nullptr) _exit(127);
    execl(takt.c_str(), "takt", "report", directory.c_str(), nullptr);
    _exit(127);
  }
  int status = 0;
  rusage used{};
  wait4(pid, &status, 0, &used);
  return {WIFEXITED(status) && WEXITSTATUS(status) == 0, static_cast<double>(ticks() - begin) * ns_per_tick() * 1e-9,
          seconds_of(used.ru_utime) + seconds_of(used.ru_stime), static_cast<double>(used.ru_maxrss) / 1024};
}

// {"open_ms":..,"jump_ms":..,"whole_ms":..}; null without node, its packages or Chromium.
nlohmann::ordered_json opened_in_browser(const std::string& page) {
  std::FILE* output = popen(fmt::format("timeout 300 node {} '{}'", TAKT_REPORT_OPEN, page).c_str(), "r");
  if (output == nullptr) return nullptr;
  std::array<char, 1024> text{};
  const std::size_t size = fread(text.data(), 1, text.size(), output);
  pclose(output);
  const auto json =
      nlohmann::ordered_json::parse(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(size), nullptr, false);
  return json.is_object() ? json : nlohmann::ordered_json(nullptr);
}

int measure(const std::string& directory, std::uint64_t ticks, const Report& report) {
  if (!fs::exists(directory + "/ticks.mcap")) {
    report.remark(fmt::format("recording {} ticks into {}", ticks, directory));
    record_long_run(directory, ticks);
  }
  const double recorded_MB = static_cast<double>(fs::file_size(directory + "/ticks.mcap")) * 1e-6;
  const Cost cost = cost_of_report(directory);
  if (!cost.done) {
    report.remark("takt report failed");
    return 1;
  }
  const double page_MB = static_cast<double>(fs::file_size(directory + "/report.html")) * 1e-6;
  report.figure(
      fmt::format("takt report: {:.1f} s ({:.1f} s of processor time), at most {:.0f} MiB, on {:.0f} MB of ticks",
                  cost.seconds, cost.cpu_seconds, cost.peak_MiB, recorded_MB),
      {{"figure", "report"},
       {"seconds", cost.seconds},
       {"cpu_seconds", cost.cpu_seconds},
       {"peak_MiB", cost.peak_MiB},
       {"ticks_MB", recorded_MB}});
  report.figure(fmt::format("report.html: {:.2f} MB (aim below {:.0f})", page_MB, kWeightTarget),
                {{"figure", "weight"}, {"MB", page_MB}, {"aim_MB", kWeightTarget}});
  const auto opened = opened_in_browser(directory + "/report.html");
  if (opened.is_null()) {
    report.remark("not opened in a browser: node, its packages (tests/node) or chromium are missing");
    return 0;
  }
  report.figure(
      fmt::format("in Chromium: everything drawn after {:.0f} ms (aim below {:.0f}), a jump to a violation after "
                  "{:.0f} ms, the whole run again after {:.0f} ms",
                  opened.at("open_ms").get<double>(), kOpenTarget, opened.at("jump_ms").get<double>(),
                  opened.at("whole_ms").get<double>()),
      {{"figure", "opened"}, {"ms", opened}, {"aim_ms", kOpenTarget}});
  return 0;
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  CLI::App app("What the report of a long run costs.");
  std::uint64_t ticks = 3'600'000;
  std::string directory;
  bool json = false;
  app.add_option("--ticks", ticks, "length of the run; 3600000: one hour")->check(CLI::Range(1'000, 100'000'000));
  app.add_option("--run", directory, "run folder to use, and to keep; recorded when it does not exist");
  app.add_flag("--json", json, "one JSON object per figure");
  CLI11_PARSE(app, argc, argv);
  (void)takt::bench::ns_per_tick();
  const takt::bench::Report report(json);
  if (!directory.empty()) return takt::bench::measure(directory, ticks, report);
  const takt::test::TemporaryDirectory temporary;
  return takt::bench::measure(temporary.path("run"), ticks, report);
}
