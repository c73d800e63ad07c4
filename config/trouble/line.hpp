// SPDX-License-Identifier: Apache-2.0
// One trouble in one line, as `takt run --at` and takt-policy-host --fault take it:
//
//   TIME [for LENGTH]: KIND [TARGET] [DOSE] [[for] LENGTH] [COMMAND]
//
//   8 s: freeze policy 300 ms         3 s for 2 s: publish_delay 100 ms         1s: load 2 400ms ./burn --all
//
// The kind's row (config/trouble/kinds.hpp) says which of these it has; what it has must be there. Pure.
#pragma once

#include <expected>
#include <string>
#include <string_view>
#include <vector>

#include "config/trouble/kinds.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::trouble {

inline constexpr std::size_t kMostCharacters = 4096;  // of a line

struct Line {
  const Row* row = nullptr;  // not null
  Duration at;
  Duration length = {};     // of a kind that has one
  std::string target = {};  // one of the row's; empty: it has none
  double dose = 0;          // in base units: ns, rad, N, kg, or as counted
  std::vector<std::string> command = {};
};

// "300ms", "300 ms", "20 s"; not negative. The error says how to write it.
std::expected<Duration, std::string> parse_time(std::string_view text);
// The error is one sentence without the line: what is wrong, and how to write it.
std::expected<Line, std::string> parse_line(std::string_view text, Place place);
// "freeze policy for 300 ms": what happens, as parse_line() takes it after "TIME: ".
std::string text_of(const Line& line);

}  // namespace takt::trouble
