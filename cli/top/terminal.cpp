// SPDX-License-Identifier: Apache-2.0
#include "cli/top/terminal.hpp"

#include <langinfo.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <clocale>
#include <csignal>
#include <cstdlib>
#include <string_view>

namespace takt::monitor::top {
namespace {

constexpr std::string_view kEnter = "\x1b[?1049h\x1b[?25l\x1b[2J";  // alternate screen, no cursor, blank
constexpr std::string_view kLeave = "\x1b[0m\x1b[?25h\x1b[?1049l";
constexpr std::string_view kClearToEnd = "\x1b[K";

volatile std::sig_atomic_t g_end = 0;
volatile std::sig_atomic_t g_suspend = 0;

constexpr std::array kEndings{SIGINT, SIGTERM, SIGHUP, SIGQUIT};

void on_signal(int number, void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  sigaction(number, &action, nullptr);
}

void catch_signals() {
  for (const int number : kEndings) on_signal(number, [](int) { g_end = 1; });
  on_signal(SIGTSTP, [](int) { g_suspend = 1; });
  on_signal(SIGWINCH, [](int) {});  // wakes read()
}

void release_signals() {
  for (const int number : kEndings) on_signal(number, SIG_DFL);
  on_signal(SIGTSTP, SIG_DFL);
  on_signal(SIGWINCH, SIG_DFL);
}

// False: the reader is gone.
bool write_all(std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(STDOUT_FILENO, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

std::string_view sequence_of(Style style) {
  switch (style) {
    case Style::plain:
      return "";
    case Style::faint:
      return "\x1b[2m";
    case Style::strong:
      return "\x1b[1m";
    case Style::good:
      return "\x1b[32m";
    case Style::warning:
      return "\x1b[33m";
    case Style::alarm:
      return "\x1b[1;31m";
  }
  return "";
}

std::string cursor_to(std::size_t row) {
  return "\x1b[" + std::to_string(row + 1) + ";1H";
}

}  // namespace

std::string encoded(const Line& line, bool coloured) {
  if (!coloured) return line.text();
  std::string text;
  Style current = Style::plain;
  for (const Piece& piece : line.pieces()) {
    if (piece.style != current) text.append("\x1b[0m").append(sequence_of(piece.style));
    current = piece.style;
    text += piece.text;
  }
  if (current != Style::plain) text += "\x1b[0m";
  return text;
}

bool wants_colour() {
  const char* const refused = std::getenv("NO_COLOR");
  const char* const terminal = std::getenv("TERM");
  return (refused == nullptr || *refused == '\0') && terminal != nullptr && std::string_view(terminal) != "dumb";
}

Glyphs glyphs_of_locale() {
  std::setlocale(LC_CTYPE, "");
  return std::string_view(nl_langinfo(CODESET)) == "UTF-8" ? Glyphs::unicode : Glyphs::ascii;
}

std::expected<std::unique_ptr<Terminal>, std::string> Terminal::open(bool coloured) {
  termios before{};
  if (isatty(STDOUT_FILENO) == 0 || tcgetattr(STDIN_FILENO, &before) != 0)
    return std::unexpected("standard input and output must be a terminal; --once prints one frame anywhere");
  return std::unique_ptr<Terminal>(new Terminal(before, coloured));
}

Terminal::Terminal(const termios& before, bool coloured) : before_(before), coloured_(coloured) {
  g_end = 0;
  g_suspend = 0;
  catch_signals();
  enter();
}

Terminal::~Terminal() {
  leave();
  release_signals();
}

void Terminal::enter() {
  termios raw = before_;
  raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  raw.c_iflag &= ~static_cast<tcflag_t>(IXON);  // no key freezes the screen
  raw.c_cc[VMIN] = 1;
  raw.c_cc[VTIME] = 0;
  tcsetattr(STDIN_FILENO, TCSADRAIN, &raw);
  shown_.clear();
  if (!write_all(kEnter)) gone_ = true;
}

void Terminal::leave() {
  (void)write_all(kLeave);
  tcsetattr(STDIN_FILENO, TCSADRAIN, &before_);
}

// Ctrl-Z: gives the terminal back, stops as the shell expects, and takes it again when continued.
void Terminal::suspend() {
  g_suspend = 0;
  leave();
  on_signal(SIGTSTP, SIG_DFL);
  raise(SIGTSTP);
  catch_signals();
  enter();
}

Size Terminal::size() const {
  winsize window{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) != 0 || window.ws_row == 0 || window.ws_col == 0) return {};
  return {window.ws_row, window.ws_col};
}

void Terminal::show(const std::vector<Line>& lines) {
  std::string changes;
  const Size now = size();
  if (now.rows != shown_size_.rows || now.columns != shown_size_.columns) {
    changes += "\x1b[2J";
    shown_.clear();
    shown_size_ = now;
  }
  shown_.resize(std::max(lines.size(), shown_.size()));
  for (std::size_t row = 0; row < shown_.size(); ++row) {
    std::string text = row < lines.size() ? encoded(lines[row], coloured_) : std::string();
    if (text == shown_[row]) continue;
    // Cleared first: at the last column a clear behind the text would take its last character.
    changes.append(cursor_to(row)).append(kClearToEnd).append(text);
    shown_[row] = std::move(text);
  }
  if (!changes.empty() && !write_all(changes)) gone_ = true;
}

std::string Terminal::read(std::chrono::milliseconds wait) {
  if (g_suspend != 0) suspend();
  pollfd input{STDIN_FILENO, POLLIN, 0};
  if (poll(&input, 1, static_cast<int>(wait.count())) <= 0) return {};
  std::array<char, 64> bytes{};
  const ssize_t count = ::read(STDIN_FILENO, bytes.data(), bytes.size());
  if (count == 0 || (count < 0 && errno != EINTR && errno != EAGAIN)) gone_ = true;
  return {bytes.data(), count > 0 ? static_cast<std::size_t>(count) : 0};
}

bool Terminal::ended() const {
  return gone_ || g_end != 0;
}

}  // namespace takt::monitor::top
