// SPDX-License-Identifier: Apache-2.0
// Takt's files of YAML name their kind in their first key, `schema: takt.robot/1`: what to do with one of another kind.
#pragma once

#include <string>
#include <string_view>

#include "config/document.hpp"

namespace takt::config {

// Adds one problem, so that no other is told: `root` is no map, or a file of another kind than `schema`, which
// ("takt.robot/1"). One of the same kind, of whatever version, or mistyped, is left to the reader. `file`: as the
// person named it. Pure.
void expect_kind(const Node& root, std::string_view schema, const std::string& file, Problems& problems);

}  // namespace takt::config
