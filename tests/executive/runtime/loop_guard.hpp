// SPDX-License-Identifier: Apache-2.0
// Watches what one thread does: allocations and locks through interposed functions, system calls through a seccomp
// filter that traps whatever is not declared. Linked into a test program, it costs other threads nothing but a branch.
#pragma once

#include <cstdint>

namespace takt::runtime::test {

struct Findings {
  std::uint64_t allocations = 0;       // malloc, free and their kin, operator new
  std::uint64_t locks = 0;             // mutex, read-write lock, condition variable
  std::uint64_t undeclared_calls = 0;  // system calls not in declared_syscalls.hpp
  std::int32_t first_undeclared = -1;  // number of the first of them
};

// From here to stop_watching() the calling thread is watched. The filter stays: such a thread cannot even end by
// itself, so run it in a process that _exits. An undeclared call fails with ENOSYS.
void watch_this_thread();
Findings stop_watching();

}  // namespace takt::runtime::test
