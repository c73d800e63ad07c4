// SPDX-License-Identifier: Apache-2.0
// `takt` is several programs, side by side: each hands on what another one carries.
#pragma once

namespace takt::cli {

inline constexpr const char* kOperateProgram = "takt-operate";
inline constexpr const char* kLabProgram = "takt-lab";

// Becomes that program, with the same words. Returns only where that failed: one line on stderr, and the exit code.
int hand_over(const char* program, char** argv);

}  // namespace takt::cli
