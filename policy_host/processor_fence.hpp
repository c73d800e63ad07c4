// SPDX-License-Identifier: Apache-2.0
// Keeps inference off the executive's processor, whatever its libraries do: a thread of theirs beside the control loop
// costs a cold cache at best, and with real-time priority the loop.
//
//   1. every thread that is there gets an affinity mask without that processor; threads started later inherit it
//   2. the kernel refuses this process's sched_setaffinity from then on (EPERM, by a seccomp filter for all threads),
//      so that no library can widen the mask again
//   3. what was loaded is looked at: no thread's mask has that processor
//
// Call the first before any engine is loaded, the last behind it (fenced_load.hpp does both). It changes the whole
// process, for good, and what it starts and becomes: mask and filter are inherited over fork and exec. A filter needs
// no privilege: it sets no_new_privs. Errors: one line. Thread rule: set-up.
#pragma once

#include <cstddef>
#include <expected>
#include <optional>
#include <string>

namespace takt::policy_host {

enum class Fence { none, by_mask, by_kernel };  // by_mask: this kernel takes no filter

// `cpu`: control.cpu of the robot file; empty: the executive has no processor of its own, and nothing is done. Nothing
// is done either on a machine of one processor. Refused: where this process may run nowhere else.
std::expected<Fence, std::string> keep_off_processor(std::optional<int> cpu);
// Refused, by name: a thread that may run there, and cannot be brought back.
std::expected<void, std::string> check_fence(std::optional<int> cpu, Fence fence);

enum class PoolSize { as_told, unless_set };
// What OpenMP and linear algebra libraries start their pools by: environment variables. unless_set: one that the user
// set stays as it is.
void limit_thread_pools(unsigned threads, PoolSize size);

// Threads of this process.
std::size_t thread_count();

}  // namespace takt::policy_host
