// SPDX-License-Identifier: Apache-2.0
// What earlier versions took in a robot file and this one does not, and what to write instead. A change that removes a
// key, or a word that a key took, adds a row.
#pragma once

#include <string_view>

#include "config/document.hpp"

namespace takt::config {

struct Migration {
  std::string_view path;   // "control.overrun_limit"; `*` stands for any name of a list or map
  std::string_view word;   // of a key that is still there: what it took; empty: the key is gone
  std::string_view since;  // the version that does not take it any more
  std::string_view cure;   // "write control.late_share: ..."
  // What a recorded run's word is read as. A key that is gone is left out of a recorded run's text.
  std::string_view recorded_as = {};
};

// Null: no earlier version took it either.
const Migration* migration_of(std::string_view path, std::string_view word = {});

// What an earlier version recorded, as this one takes it: for looking back only, never for what is to move a robot.
void migrate_recorded(Node& root);

}  // namespace takt::config
