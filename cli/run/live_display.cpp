// SPDX-License-Identifier: Apache-2.0
#include "cli/run/live_display.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "cli/run/status_text.hpp"

namespace takt::cli {

LiveDisplay::LiveDisplay(Duration max_age) : terminal_(isatty(STDOUT_FILENO) != 0), max_age_(max_age) {}

void LiveDisplay::show(Duration since_start, const StatusSnapshot& status) {
  const std::string line = fmt::format("{:6.1f} s  {}", since_start.seconds(), status_line(status, max_age_));
  if (terminal_) {
    fmt::print("\r\x1b[K{}", line);
    line_is_open_ = true;
  } else if (since_start >= next_line_ || shown_mode_ != status.tick.mode) {
    fmt::print("{}\n", line);
    next_line_ = since_start + seconds(1);
  }
  shown_mode_ = status.tick.mode;
  std::fflush(stdout);
}

void LiveDisplay::note(std::string_view sentence) {
  finish();
  fmt::print("{}\n", sentence);
  std::fflush(stdout);
}

void LiveDisplay::finish() {
  if (line_is_open_) fmt::print("\n");
  line_is_open_ = false;
}

}  // namespace takt::cli
