// SPDX-License-Identifier: Apache-2.0
#include "cli/lab/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <utility>

namespace takt::cli {
namespace {

constexpr std::size_t kBarWidth = 20;
constexpr Duration kSilent = seconds(2), kBetweenRewrites = milliseconds(100), kBetweenLines = seconds(30);

std::string bar(std::size_t done, std::size_t planned) {
  const std::size_t filled = planned == 0 ? 0 : kBarWidth * std::min(done, planned) / planned;
  return fmt::format("[{:#<{}}{:.<{}}] ", "", filled, "", kBarWidth - filled);
}

std::string time_left(std::size_t done, std::size_t planned, Duration passed) {
  if (done == 0) return {};
  const double share = static_cast<double>(done) / static_cast<double>(planned);
  const auto left = static_cast<int>(std::lround(passed.seconds() * (1 / share - 1)));
  return fmt::format(", {}:{:02d} left", left / 60, left % 60);
}

}  // namespace

ProgressPlace on_stderr() {
  return {.is_terminal = ::isatty(STDERR_FILENO) == 1,
          .now =
              [] {
                return MonoTime{std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count()};
              },
          .write =
              [](std::string_view text) {
                fmt::print(stderr, "{}", text);
                std::fflush(stderr);
              }};
}

Progress::Progress(std::string unit, ProgressPlace place)
    : place_(std::move(place)), unit_(std::move(unit)), begun_(place_.now()) {}

Progress::~Progress() {
  if (place_.is_terminal && shown_) place_.write("\r\033[K");
}

void Progress::show(std::size_t done, std::size_t planned, std::string_view note) {
  const MonoTime now = place_.now();
  const Duration between = place_.is_terminal ? kBetweenRewrites : kBetweenLines;
  if (now - begun_ < kSilent || now - shown_.value_or(begun_) < between) return;
  shown_ = now;
  const std::string text = fmt::format("{}/{} {}{}{}{}", done, planned, unit_, time_left(done, planned, now - begun_),
                                       note.empty() ? "" : ": ", note);
  // A line longer than the terminal is cut off instead of wrapped, which could not be rewritten.
  if (place_.is_terminal)
    place_.write(fmt::format("\r\033[?7l{}{}\033[K\033[?7h", bar(done, planned), text));
  else
    place_.write(text + "\n");
}

}  // namespace takt::cli
