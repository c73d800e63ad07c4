// SPDX-License-Identifier: Apache-2.0
// make_age_picture FILE.svg: the age of the command in use, its limit, and what the robot does, while a policy freezes
// for 300 ms and is gone 1.2 s later. The virtual robot records it, so that the same sources give the same bytes.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "evidence/review/svg.hpp"
#include "monitor/record/bounded_file.hpp"
#include "tests/monitor/record/recorded_demo.hpp"

namespace takt::monitor {
namespace {

constexpr std::uint64_t kFrozenAt = 1'400, kThawedAt = 1'700, kGoneAt = 2'900;  // ticks of 1 ms
constexpr std::uint64_t kShownFrom = 1'000, kTicks = 4'200;

constexpr double kWidth = 860, kHeight = 250, kLeft = 90, kRight = 850;
constexpr double kOldestShown = 300;  // ms: what is older is cut at the top
constexpr double kTop = 44, kBottom = 160, kModeTop = 178, kModeBottom = 204;

double x_of(std::uint64_t tick) {
  return kLeft + (kRight - kLeft) * static_cast<double>(tick - kShownFrom) / static_cast<double>(kTicks - kShownFrom);
}
double y_of(double age_ms) {
  return kBottom - (kBottom - kTop) * std::min(age_ms, kOldestShown) / kOldestShown;
}

std::string_view colour(Mode mode) {
  if (mode == Mode::tracking) return "#4ade80";
  return mode == Mode::degraded ? "#fbbf24" : "#f87171";
}

bool is_straight(const evidence::SvgPoint& a, const evidence::SvgPoint& b, const evidence::SvgPoint& c) {
  return std::abs((b.x - a.x) * (c.y - b.y) - (b.y - a.y) * (c.x - b.x)) < 1e-3 * (c.x - a.x);
}

struct Story {
  std::vector<evidence::SvgPoint> ages;
  struct Stretch {
    Mode mode;
    std::uint64_t from, to;  // ticks
  };
  std::vector<Stretch> modes;

  void take(const TickRecordHeader& header) {
    if (header.tick < kShownFrom) return;
    if (modes.empty() || modes.back().mode != header.mode) modes.push_back({header.mode, header.tick, header.tick});
    modes.back().to = header.tick + 1;
    const evidence::SvgPoint point{x_of(header.tick), y_of(header.age.total().milliseconds())};
    if (ages.size() > 1 && is_straight(ages[ages.size() - 2], ages.back(), point)) ages.pop_back();
    ages.push_back(point);
  }
};

Story story_of(const RecordedRun& run) {
  Story story;
  const auto scanned = scan_run(run, {.tick = [&](const RecordedTick& tick) { story.take(tick.record.header); },
                                      .command = {},
                                      .keyframe = {},
                                      .loss = {}});
  if (!scanned) throw std::runtime_error(scanned.error());
  return story;
}

std::string event(std::uint64_t tick, std::string_view what, std::string_view anchor) {
  return evidence::svg_line(x_of(tick), kTop - 6, x_of(tick), kModeBottom, "#9ca3af") +
         evidence::svg_text(x_of(tick), kTop - 12, what, anchor);
}

std::string picture_of(const Story& story, Duration max_age) {
  const double limit = y_of(max_age.milliseconds());
  std::string body = evidence::svg_text(kLeft - 8, y_of(0), "0", "end") +
                     evidence::svg_text(kLeft - 8, limit + 4, fmt::format("{:.0f} ms", max_age.milliseconds()), "end") +
                     evidence::svg_text(kLeft - 8, kTop + 4, fmt::format("{:.0f} ms +", kOldestShown), "end") +
                     evidence::svg_text(kLeft - 8, kTop - 16, "age", "end") +
                     evidence::svg_text(kLeft - 8, kModeBottom - 8, "mode", "end") +
                     evidence::svg_line(kLeft, limit, kRight, limit, "#c2410c") +
                     evidence::svg_text(kRight, limit - 6, "max_age", "end") +
                     event(kFrozenAt, "policy frozen", "end") + event(kThawedAt, "goes on", "start") +
                     event(kGoneAt, "policy killed", "middle") + evidence::svg_polyline(story.ages, "#1d4ed8");
  for (const auto& [mode, from, to] : story.modes) {
    std::string called(name(mode));
    std::ranges::replace(called, '_', ' ');
    const double middle = (x_of(from) + x_of(to)) / 2;
    body += evidence::svg_rectangle({x_of(from), kModeTop, x_of(to) - x_of(from), kModeBottom - kModeTop}, colour(mode),
                                    0.5, called) +
            evidence::svg_text(middle, kModeBottom - 8, called, "middle");
  }
  body += evidence::svg_text(
      kWidth / 2, kHeight - 16,
      "A stale command is never played: the robot holds, goes on when fresh commands return, and stops when none do.",
      "middle");
  return evidence::svg_document(kWidth, kHeight,
                                "Age of the command in use, its limit, and what the robot does meanwhile", body);
}

}  // namespace
}  // namespace takt::monitor

int main(int argc, char** argv) {
  using namespace takt::monitor;
  if (argc != 2) return 64;
  const std::string folder = std::filesystem::temp_directory_path() / fmt::format("takt-picture-{}", getpid());
  try {
    VirtualRobot robot;
    const RecordedRun run = record(robot, folder, kTicks, [&](std::uint64_t tick) {
      robot.policy_is_frozen = (tick >= kFrozenAt && tick < kThawedAt) || tick >= kGoneAt;
    });
    const auto written = replace_file(argv[1], picture_of(story_of(run), demo_robot().freshness.max_age));
    std::filesystem::remove_all(folder);
    if (!written) throw std::runtime_error(written.error());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_age_picture: %s\n", error.what());
    return 1;
  }
  return 0;
}
