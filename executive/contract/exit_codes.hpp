// SPDX-License-Identifier: Apache-2.0
// How every program of Takt ends (docs/exit-codes.md): 0, or one of these after one line on stderr per reason. A
// refused configuration is config::kExitBadConfiguration (65).
#pragma once

namespace takt {

inline constexpr int kExitFailed = 1;         // the check failed, the request was refused
inline constexpr int kExitUsage = 64;         // command line
inline constexpr int kExitUnavailable = 69;   // a process, socket, bus or domain that it needs is not there
inline constexpr int kExitInternal = 70;      // our own bug
inline constexpr int kExitSetUpRefused = 71;  // real time, permissions, or another process has this robot

}  // namespace takt
