// SPDX-License-Identifier: Apache-2.0
// What several joints share, written once: each block of `joint_defaults` says which joints it is for, by patterns of
// names (* any letters, ? one), and gives keys of `joints[]`. A joint's own key wins over every block, a later block
// over an earlier one; sections are joined key by key. What comes out is the same robot, and the same hash, as one that
// is written out.
#pragma once

#include "config/document.hpp"

namespace takt::config {

inline constexpr std::string_view kJointDefaults = "joint_defaults";

// Moves the blocks of `root` into its joints. Problems: a block that is no map, has no patterns, names a joint or fits
// none. Afterwards a problem inside a block is told once, with the block and the joints that share it.
void spread_joint_defaults(Node& root, Problems& problems);

}  // namespace takt::config
