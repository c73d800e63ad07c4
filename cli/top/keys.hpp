// SPDX-License-Identifier: Apache-2.0
// What a person at `takt top` asks for by key. Arming needs a second key, and soon; a stop never does. Pure: the clock
// is passed in. Thread rule: one thread at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "executive/contract/mono_time.hpp"

namespace takt::monitor::top {

enum class Wish : std::uint8_t { quit, arm, stop, reset, mark, snapshot };

inline constexpr Duration kConfirmWithin = seconds(5);
inline constexpr Duration kNoteStays = seconds(8);

// What the screen needs to know of the keyboard.
struct Prompt {
  bool confirms_arm = false;  // asks: really?
  bool help = false;
  std::size_t scroll = 0;  // joints above the first one shown; the screen clamps it
  std::string note{};      // answer to the last wish; one line
  bool note_is_bad = false;
};

// Keys in what a terminal sent: arrow up and down become k and j, other escape sequences vanish whole.
std::string keys_of(std::string_view bytes);

class Keys {
 public:
  explicit Keys(std::size_t joints) : joints_(joints) {}
  // Nothing: the key changed the prompt at most.
  std::optional<Wish> press(char key, MonoTime now);
  void note(std::string text, bool is_bad, MonoTime now);
  // What to show now.
  const Prompt& prompt(MonoTime now);

 private:
  std::optional<Wish> confirm(char key);
  void scroll(char key);

  std::size_t joints_;
  Prompt prompt_;
  MonoTime asked_at_, noted_at_;
};

}  // namespace takt::monitor::top
