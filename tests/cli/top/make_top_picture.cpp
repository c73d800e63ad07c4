// SPDX-License-Identifier: Apache-2.0
// make_top_picture FILE.svg: what `takt top` shows while the README's story runs: a policy that freezes for 300 ms at 8
// s and is gone at 17 s. The virtual robot records it, so that the same sources give the same bytes. One frame a
// second, played at twice the speed; a word that stays is drawn once. Reduced motion: the
// last frame.
#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <utility>
#include <vector>

#include "cli/top/live_view.hpp"
#include "cli/top/screen.hpp"
#include "monitor/record/bounded_file.hpp"
#include "tests/monitor/record/recorded_demo.hpp"

namespace takt::monitor::top {
namespace {

constexpr Size kScreen{24, 88};
constexpr double kCellWidth = 8.4, kCellHeight = 16.5, kMargin = 14;
constexpr std::uint64_t kTicks = 20'000, kTicksPerFrame = 1'000;
constexpr double kFrameSeconds = 0.5;

using Frame = std::vector<Line>;

std::vector<Frame> frames_of(const RecordedRun& run) {
  LiveView view(demo_robot());
  view.begin();
  std::vector<Frame> frames;
  const auto scanned = scan_run(
      run, {.tick =
                [&](const RecordedTick& tick) {
                  view.tick(tick.record);
                  if (tick.record.header.tick % kTicksPerFrame == 0)
                    frames.push_back(render(view.picture(tick.record.header.now), {}, kScreen, Glyphs::unicode));
                },
            .command = [](const RecordedCommand&) {},
            .keyframe = {},
            .loss = {}});
  if (!scanned) throw std::runtime_error(scanned.error());
  return frames;
}

constexpr std::string_view kLooks =
    "text{fill:#d5dce4}.f{fill:#8793a0}.s{fill:#fff;font-weight:bold}.g{fill:#6abf87}.w{fill:#f0b429}"
    ".a{fill:#ff7b6b;font-weight:bold}";

std::string_view look_of(Style style) {
  switch (style) {
    case Style::plain:
      return "";
    case Style::faint:
      return " class=\"f\"";
    case Style::strong:
      return " class=\"s\"";
    case Style::good:
      return " class=\"g\"";
    case Style::warning:
      return " class=\"w\"";
    case Style::alarm:
      return " class=\"a\"";
  }
  return "";
}

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) out += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : std::string(1, c);
  return out;
}

// A word stands on its cells, whatever font is there.
std::string drawn(std::string_view word, Style style, std::size_t row, std::size_t column) {
  return fmt::format("<text x=\"{:.4g}\" y=\"{:.4g}\" textLength=\"{:.4g}\"{}>{}</text>",
                     kMargin + kCellWidth * static_cast<double>(column),
                     kMargin + kCellHeight * (static_cast<double>(row) + 0.75),
                     kCellWidth * static_cast<double>(cells(word)), look_of(style), escaped(word));
}

// Which frames show a word where it stands.
using Words = std::map<std::string, std::vector<std::size_t>>;

void take_words(const Line& line, std::size_t row, std::size_t frame, Words& words) {
  std::size_t column = 0;
  for (const Piece& piece : line.pieces()) {
    const std::string_view text = piece.text;
    for (std::size_t at = text.find_first_not_of(' '); at != std::string_view::npos;) {
      const std::size_t end = std::min(text.find(' ', at), text.size());
      const std::size_t before = column + cells(text.substr(0, at));
      words[drawn(text.substr(at, end - at), piece.style, row, before)].push_back(frame);
      at = text.find_first_not_of(' ', end);
    }
    column += cells(text);
  }
}

// Visible from one frame up to another.
std::string shown(const std::string& content, std::size_t from, std::size_t to, std::size_t frames) {
  if (content.empty()) return {};
  const auto at = [&](std::size_t frame) { return static_cast<double>(frame) / static_cast<double>(frames); };
  if (from == 0 && to == frames) return content + "\n";
  const std::string values =
      from == 0      ? fmt::format("values=\"visible;hidden\" keyTimes=\"0;{:.4g}\"", at(to))
      : to == frames ? fmt::format("values=\"hidden;visible\" keyTimes=\"0;{:.4g}\"", at(from))
                     : fmt::format("values=\"hidden;visible;hidden\" keyTimes=\"0;{:.4g};{:.4g}\"", at(from), at(to));
  return fmt::format(
      "<g visibility=\"{}\"><animate attributeName=\"visibility\" {} calcMode=\"discrete\" dur=\"{}s\" "
      "repeatCount=\"indefinite\"/>{}</g>\n",
      to == frames ? "visible" : "hidden", values, kFrameSeconds * static_cast<double>(frames), content);
}

std::string picture_of(const std::vector<Frame>& frames) {
  Words words;
  for (std::size_t frame = 0; frame < frames.size(); ++frame)
    for (std::size_t row = 0; row < frames[frame].size(); ++row) take_words(frames[frame][row], row, frame, words);
  std::map<std::pair<std::size_t, std::size_t>, std::string> stretches;  // frames from, up to: what they show
  for (const auto& [word, in] : words)
    for (std::size_t first = 0, last = 0; first < in.size(); first = last + 1) {
      for (last = first; last + 1 < in.size() && in[last + 1] == in[last] + 1;) ++last;
      stretches[{in[first], in[last] + 1}] += word;
    }
  std::string body;
  for (const auto& [stretch, content] : stretches) body += shown(content, stretch.first, stretch.second, frames.size());
  const double width = 2 * kMargin + kCellWidth * kScreen.columns, height = 2 * kMargin + kCellHeight * kScreen.rows;
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
      "font-family=\"DejaVu Sans Mono, Menlo, Consolas, monospace\" font-size=\"14\" xml:space=\"preserve\">\n"
      "<title>takt top: a policy freezes at 8 s and is gone at 17 s; the robot degrades, recovers, and stops</title>\n"
      "<style>{3}</style>\n"
      "<rect width=\"{0}\" height=\"{1}\" rx=\"8\" fill=\"#10151b\"/>\n{2}</svg>\n",
      width, height, body, kLooks);
}

}  // namespace
}  // namespace takt::monitor::top

int main(int argc, char** argv) {
  using namespace takt::monitor;
  if (argc != 2) return 64;
  const std::string folder = std::filesystem::temp_directory_path() / fmt::format("takt-picture-{}", getpid());
  try {
    VirtualRobot robot;
    const RecordedRun run = record(robot, folder, top::kTicks, [&](std::uint64_t tick) {
      robot.policy_is_frozen = (tick >= 8'000 && tick < 8'300) || tick >= 17'000;
    });
    const auto written = replace_file(argv[1], top::picture_of(top::frames_of(run)));
    std::filesystem::remove_all(folder);
    if (!written) throw std::runtime_error(written.error());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_top_picture: %s\n", error.what());
    return 1;
  }
  return 0;
}
