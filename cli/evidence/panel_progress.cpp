#include "cli/evidence/panel_progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>

namespace takt::cli {
namespace {

constexpr std::size_t kBarWidth = 30;
constexpr std::chrono::milliseconds kBetween{100};

}  // namespace

PanelProgress::PanelProgress(std::size_t planned) : terminal_(::isatty(STDERR_FILENO) == 1), planned_(planned) {}

PanelProgress::~PanelProgress() {
  if (terminal_) fmt::print(stderr, "\r\033[K");
}

void PanelProgress::one_more() {
  ++done_;
  const Clock::time_point now = Clock::now();
  if (!terminal_ || (now - shown_ < kBetween && done_ != planned_)) return;
  shown_ = now;
  show(now);
}

void PanelProgress::show(Clock::time_point now) {
  const double share = static_cast<double>(done_) / static_cast<double>(planned_);
  const double passed = std::chrono::duration<double>(now - started_).count();
  const auto filled = static_cast<std::size_t>(share * kBarWidth);
  const auto left = static_cast<int>(std::lround(passed / share - passed));
  fmt::print(stderr, "\r[{:#<{}}{:.<{}}] {}/{} rollouts, {}:{:02d} left\033[K", "", filled, "", kBarWidth - filled,
             done_, planned_, left / 60, left % 60);
  std::fflush(stderr);
}

}  // namespace takt::cli
