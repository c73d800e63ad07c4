// SPDX-License-Identifier: Apache-2.0
// The terminal while `takt top` has it: keys one by one and unechoed, the alternate screen, no cursor. The destructor
// gives it back as it was; so do SIGINT, SIGTERM, SIGHUP and SIGQUIT, after which ended() holds, and SIGTSTP, which
// suspends and comes back. After SIGKILL nothing does: `reset` restores the terminal then.
//
// ANSI sequences by hand instead of a library: eight of them, which every terminal since the VT220 and tmux understand,
// serve a screen that is rendered as plain lines anyway; ncurses would want to own signals, input and exits.
//
// One at a time in a process: signal handlers have no other place to leave their word. Thread rule: one thread.
#pragma once

#include <sys/types.h>
#include <termios.h>

#include <chrono>
#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "cli/top/screen.hpp"

namespace takt::monitor::top {

// As bytes for a terminal; without colour, plain text.
std::string encoded(const Line& line, bool coloured);

// NO_COLOR is unset or empty (https://no-color.org) and the terminal is not a dumb one.
bool wants_colour();
// The locale's character set is UTF-8.
Glyphs glyphs_of_locale();

class Terminal {
 public:
  // The error: standard input or output is no terminal.
  static std::expected<std::unique_ptr<Terminal>, std::string> open(bool coloured);
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  [[nodiscard]] Size size() const;
  // Sends what differs from the lines shown before.
  void show(const std::vector<Line>& lines);
  // Bytes typed until then; returns early when there are some, or a signal came.
  std::string read(std::chrono::milliseconds wait);
  // A signal asked for the end, or the terminal went away.
  [[nodiscard]] bool ended() const;

 private:
  Terminal(const termios& before, bool coloured);
  void enter();
  void leave();
  void suspend();

  termios before_;
  bool coloured_;
  bool gone_ = false;
  std::vector<std::string> shown_;
  Size shown_size_{0, 0};
};

}  // namespace takt::monitor::top
