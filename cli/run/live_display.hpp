// SPDX-License-Identifier: Apache-2.0
// What a person sees while a robot runs: on a terminal one line that is rewritten ten times a second, elsewhere one
// line a second and one per change of mode. Notes get a line of their own. No colour, plain text.
#pragma once

#include <optional>
#include <string_view>

#include "executive/contract/session.hpp"

namespace takt::cli {

class LiveDisplay {
 public:
  explicit LiveDisplay(Duration max_age);
  void show(Duration since_start, const StatusSnapshot& status);
  void note(std::string_view sentence);
  // Leaves the last line standing.
  void finish();

 private:
  bool terminal_;
  bool line_is_open_ = false;
  Duration max_age_;
  Duration next_line_;
  std::optional<Mode> shown_mode_;
};

}  // namespace takt::cli
