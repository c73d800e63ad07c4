// SPDX-License-Identifier: Apache-2.0
// Who asked for what of the robot, and what came of it: told by the executive to the recorder. A stop that finds the
// service thread busy acts first and is told later. Thread rule: none of this ever reaches the control thread.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "executive/contract/layout.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/session.hpp"

namespace takt {

// "press stop" is `takt stop`, whose second press takes the power; "stop" is a program's; "de-energise" takes it at
// once.
constexpr std::string_view name(OperatorVerb verb) {
  constexpr std::array<std::string_view, kOperatorVerbCount> names{"status",     "arm",         "stop", "reset", "mark",
                                                                   "press stop", "de-energise", "swap", "back"};
  const auto index = static_cast<std::size_t>(verb);
  return index < names.size() ? names[index] : "invalid";
}

struct OperatorWord {
  std::uint64_t magic = kMagic;
  MonoTime heard_at;      // when the executive heard it
  std::int32_t pid = 0;   // the kernel's word, as the next two
  std::uint32_t uid = 0;  // user
  char program[16] = {};  // printable; /proc/PID/comm, which the process may change; empty: it has ended
  OperatorVerb verb = OperatorVerb::status;
  std::uint8_t done = 0;  // 1: it was done; 0: refused, or not noticed in time
  std::uint8_t reserved[6] = {};
  char answer[200] = {};  // the first sentence of the answer; empty: none. Zero-terminated, zero-padded
};
template <std::same_as<OperatorWord> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(magic), TAKT_FIELD(heard_at), TAKT_FIELD(pid),      TAKT_FIELD(uid),    TAKT_FIELD(program),
      TAKT_FIELD(verb),  TAKT_FIELD(done),     TAKT_FIELD(reserved), TAKT_FIELD(answer),
  };
}
static_assert(std::is_standard_layout_v<OperatorWord> && sizeof(OperatorWord) == 248);

}  // namespace takt
