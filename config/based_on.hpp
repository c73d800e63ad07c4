// SPDX-License-Identifier: Apache-2.0
// A robot file that says how it differs from another one: `based_on: FILE` names a robot file in the same folder, whose
// keys hold where this file has none. Sections are joined key by key; a list or a value of this file replaces the
// base's. What comes out is the same robot, and the same hash, as one that is written out.
#pragma once

#include <string>

#include "config/document.hpp"

namespace takt::config {

inline constexpr std::string_view kBasedOn = "based_on";

// Reads the base that `root` names, if it names one, and adds its keys to `root`. `file`: where root was read, for its
// folder. Problems: a base that cannot be read, lies in another folder (its paths would name other files), is no robot
// file, or is based on another file itself.
void add_base(Node& root, const std::string& file, Problems& problems);

}  // namespace takt::config
