// SPDX-License-Identifier: Apache-2.0
// How far a long piece of work is, and how long it will still take. Nothing for its first 2 s; then on a terminal one
// line with a bar, rewritten; elsewhere a line every 30 s.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "executive/contract/mono_time.hpp"

namespace takt::cli {

// Where it is shown, and by which clock.
struct ProgressPlace {
  bool is_terminal = false;
  std::function<MonoTime()> now;
  std::function<void(std::string_view)> write;
};
ProgressPlace on_stderr();

class Progress {
 public:
  // `unit`: what is counted, "rollouts".
  explicit Progress(std::string unit, ProgressPlace place = on_stderr());
  ~Progress();  // leaves the terminal's line empty
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // `note`: what is worked at now. The time left supposes that the rest takes as long as what is done.
  void show(std::size_t done, std::size_t planned, std::string_view note = {});

 private:
  ProgressPlace place_;
  std::string unit_;
  MonoTime begun_;
  std::optional<MonoTime> shown_;
};

}  // namespace takt::cli
