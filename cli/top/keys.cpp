// SPDX-License-Identifier: Apache-2.0
#include "cli/top/keys.hpp"

#include <algorithm>
#include <utility>

namespace takt::monitor::top {
namespace {

constexpr char kEscape = '\x1b';

// Length of the escape sequence at the beginning of `bytes`: ESC [ parameters final, ESC O letter, ESC character.
std::size_t sequence_length(std::string_view bytes) {
  if (bytes.size() < 2) return bytes.size();
  if (bytes[1] == 'O') return std::min<std::size_t>(bytes.size(), 3);
  if (bytes[1] != '[') return 2;
  const auto final_byte = std::find_if(bytes.begin() + 2, bytes.end(), [](char c) { return c >= '@' && c <= '~'; });
  return static_cast<std::size_t>(final_byte - bytes.begin()) + (final_byte == bytes.end() ? 0 : 1);
}

}  // namespace

std::string keys_of(std::string_view bytes) {
  std::string keys;
  while (!bytes.empty()) {
    const std::size_t length = bytes.front() == kEscape ? sequence_length(bytes) : 1;
    const std::string_view one = bytes.substr(0, length);
    if (one.front() != kEscape) keys += one;
    if (one == "\x1b[A" || one == "\x1bOA") keys += 'k';
    if (one == "\x1b[B" || one == "\x1bOB") keys += 'j';
    bytes.remove_prefix(length);
  }
  return keys;
}

std::optional<Wish> Keys::confirm(char key) {
  prompt_.confirms_arm = false;
  if (key == 'y' || key == 'Y') return Wish::arm;
  if (key == 's') return Wish::stop;
  return std::nullopt;
}

void Keys::scroll(char key) {
  if (key == 'j' && prompt_.scroll + 1 < joints_) ++prompt_.scroll;
  if (key == 'k' && prompt_.scroll > 0) --prompt_.scroll;
}

std::optional<Wish> Keys::press(char key, MonoTime now) {
  if (prompt(now).confirms_arm) return confirm(key);
  switch (key) {
    case 'q':
      return Wish::quit;
    case 's':
      return Wish::stop;
    case 'r':
      return Wish::reset;
    case 'm':
      return Wish::mark;
    case 'p':
      return Wish::snapshot;
    case 'a':
      prompt_.confirms_arm = true;
      asked_at_ = now;
      return std::nullopt;
    case '?':
      prompt_.help = !prompt_.help;
      return std::nullopt;
    default:
      scroll(key);
      return std::nullopt;
  }
}

void Keys::note(std::string text, bool is_bad, MonoTime now) {
  prompt_.note = std::move(text);
  prompt_.note_is_bad = is_bad;
  noted_at_ = now;
}

const Prompt& Keys::prompt(MonoTime now) {
  if (prompt_.confirms_arm && now - asked_at_ > kConfirmWithin) prompt_.confirms_arm = false;
  if (now - noted_at_ > kNoteStays) prompt_.note.clear();
  return prompt_;
}

}  // namespace takt::monitor::top
