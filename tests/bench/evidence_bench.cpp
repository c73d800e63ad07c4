// SPDX-License-Identifier: Apache-2.0
// What evidence costs: the seal of a record while it grows, and an auditor's work on an artifact of many rows.
//
// Figures: share of a core that sealing takes at 1 kHz, of a virtual robot of six joints with encoder noise; seconds of
// `takt audit` on an artifact of a real panel, and of `takt audit --recompute 1%` on two cores.
#include <fmt/format.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>
#include <span>

#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_seal.hpp"
#include "monitor/record/segment_seal.hpp"
#include "tests/bench/bench.hpp"
#include "tests/bench/lively_robot.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::bench {
namespace {

namespace fs = std::filesystem;
constexpr double kSealTarget = 1.0;        // % of a core
constexpr double kAuditTarget = 10.0;      // s, of kRows
constexpr double kRecomputeTarget = 60.0;  // s, of a hundredth of kRows
constexpr std::uint64_t kRows = 10'000;
constexpr std::uint64_t kRowsPerSeed = 4;  // two methods, two perturbations
constexpr std::uint64_t kSealedTicks = 60'000, kTicksPerSecond = 1'000;
constexpr std::size_t kPiece = 4'096;  // the least that a file takes at a time

constexpr const char* kPanel = R"(schema: takt.panel/1
panel: evidence
duration: 1 s
seeds: {{ first: 1, count: {} }}
window: {{ from: 300 ms, for: 200 ms }}
tasks:
  - {{ task: cart_pole_balance, robot: {}, scored: 500 ms, bound: 400 mm }}
methods:
  - {{ name: file, description: as the robot file says }}
  - {{ name: seldom, description: every second observation, override: [{{ key: policy.period, value: 40 ms }}] }}
perturbations:
  - {{ kind: none }}
  - {{ kind: sensor_dropout, dose: 0.2 }}
claims: {{ conceptual: what evidence costs, systems: how many rows there are, evidence: seconds of an audit }}
)";

double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// As the recorder does it: each piece on its way to the disk, a segment closed every ten seconds, and the seal written
// anew every minute.
void measure_sealing(const std::string& directory, const Report& report) {
  std::mt19937_64 random(1);
  monitor::VirtualRobot robot;
  make_lively(robot, random);
  const auto run = monitor::record(robot, directory, kSealedTicks, [](std::uint64_t) {});
  std::vector<std::string> contents;
  for (const char* const file : {"ticks.mcap", "can.log.zst", "transitions.jsonl"})
    contents.push_back(monitor::read_file(directory + "/" + file).value());
  std::array<monitor::SegmentSeal, 3> seals;
  std::size_t bytes = 0;
  const double begin = processor_seconds();
  for (std::size_t file = 0; file < contents.size(); ++file) {
    auto left = std::as_bytes(std::span(contents[file]));
    bytes += left.size();
    const std::size_t per_segment = left.size() / 6 + 1;
    for (std::size_t open = 0; !left.empty(); left = left.subspan(std::min(kPiece, left.size()))) {
      seals[file].add(left.first(std::min(kPiece, left.size())));
      open += kPiece;
      if (open < per_segment) continue;
      seals[file].close(1);
      open = 0;
    }
    seals[file].close(1);
  }
  const auto text = monitor::run_seal_text(run.folder, "evidence", true,
                                           {{"ticks.mcap", seals[0].closed()},
                                            {"can.log.zst", seals[1].closed()},
                                            {"transitions.jsonl", seals[2].closed()}});
  const double seconds = processor_seconds() - begin;
  const double share = 100 * seconds / (static_cast<double>(kSealedTicks) / static_cast<double>(kTicksPerSecond));
  report.figure(fmt::format("sealing: {:.3f} % of a core at 1 kHz (aim at most {:g} %), {:.0f} kB a second", share,
                            kSealTarget, static_cast<double>(bytes) * 1e-3 / (kSealedTicks / kTicksPerSecond)),
                {{"figure", "sealing"}, {"percent_of_core", share}, {"aim_percent", kSealTarget}, {"bytes", bytes}});
  if (!text) report.remark(text.error());
}

// Wall seconds of `takt WORDS`; its exit code is `expected`, or none.
std::optional<double> seconds_of(std::vector<std::string> words, int expected) {
  const std::string takt = fs::read_symlink("/proc/self/exe").parent_path() / "takt";
  words.insert(words.begin(), "takt");
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const std::int64_t begin = ticks();
  const pid_t pid = fork();
  if (pid == 0) {
    if (std::freopen("/dev/null", "w", stdout) == nullptr) _exit(127);
    execv(takt.c_str(), argv.data());
    _exit(127);
  }
  int status = 0;
  waitpid(pid, &status, 0);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != expected) return std::nullopt;
  return static_cast<double>(ticks() - begin) * ns_per_tick() * 1e-9;
}

int measure_audits(const std::string& directory, std::uint64_t rows, const Report& report) {
  const std::string panel = directory + "/panel.yaml", artifact = directory + "/artifact";
  std::ofstream(panel) << fmt::format(kPanel, rows / kRowsPerSeed, fs::absolute("config/cart_pole.yaml").string());
  const auto run = seconds_of({"panel", "run", panel, "--out", artifact, "--workers", "2"}, 0);
  if (!run) {
    report.remark("takt panel run failed");
    return 1;
  }
  report.remark(fmt::format("{} rows took {:.0f} s", rows, *run));
  const auto figure = [&](const char* name, const std::vector<std::string>& words, double aim_s) {
    const auto seconds = seconds_of(words, 0);
    if (!seconds) {
      report.remark(fmt::format("takt {} failed", name));
      return 1;
    }
    report.figure(fmt::format("{} of {} rows: {:.1f} s (aim at most {:g} s of {})", name, rows, *seconds, aim_s, kRows),
                  {{"figure", name}, {"rows", rows}, {"seconds", *seconds}, {"aim_seconds", aim_s}});
    return 0;
  };
  const int audited = figure("audit", {"audit", artifact}, kAuditTarget);
  return audited +
         figure("audit --recompute 1%", {"audit", artifact, "--recompute", "1%", "--workers", "2"}, kRecomputeTarget);
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  using namespace takt::bench;
  CLI::App app("What sealing a record and auditing an artifact cost.");
  std::uint64_t rows = kRows;
  bool json = false;
  app.add_option("--rows", rows, "of the artifact")->check(CLI::Range(400, 1'000'000));
  app.add_flag("--json", json, "one JSON object per figure");
  CLI11_PARSE(app, argc, argv);
  (void)ns_per_tick();
  const Report report(json);
  const takt::test::TemporaryDirectory directory;
  measure_sealing(directory.path("run"), report);
  return measure_audits(directory.path(), rows, report) == 0 ? 0 : 1;
}
