// SPDX-License-Identifier: Apache-2.0
// How takt-executive ends: 0 after an orderly shutdown, otherwise one of these, after one line on stderr per reason.
#pragma once

namespace takt::runtime {

inline constexpr int kExitUsage = 64;         // command line
inline constexpr int kExitUnavailable = 69;   // a required bus cannot be had
inline constexpr int kExitInternal = 70;      // our own bug
inline constexpr int kExitSetUpRefused = 71;  // real-time set-up, permissions, or somebody else has this robot
// A refused configuration ends with config::kExitBadConfiguration (65).

}  // namespace takt::runtime
