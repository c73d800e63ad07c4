// SPDX-License-Identifier: Apache-2.0
// Every system call that the control thread makes between its first and its last tick. Anything else is a defect:
// tests/executive/runtime/loop_guard_test.cpp runs the loop under a filter of exactly this table.
// Reading CLOCK_MONOTONIC, CLOCK_BOOTTIME and CLOCK_REALTIME is no system call where the vDSO serves them, and is
// covered where it does not.
#pragma once

#include <sys/syscall.h>

#include <array>

namespace takt::runtime {

struct DeclaredSyscall {
  int number;
  const char* name;
  const char* what_for;
};

inline constexpr std::array kDeclaredSyscalls{
    DeclaredSyscall{SYS_clock_nanosleep, "clock_nanosleep", "waits for the period"},
    DeclaredSyscall{SYS_sendto, "sendto", "one per frame sent, never blocking"},
    DeclaredSyscall{SYS_recvmmsg, "recvmmsg", "frames received, up to 32 at a time, never blocking"},
    DeclaredSyscall{SYS_clock_gettime, "clock_gettime", "evidence: CPU time of the thread"},
    DeclaredSyscall{SYS_pread64, "pread64", "evidence: run delay, from the schedstat file opened before the loop"},
    DeclaredSyscall{SYS_ioctl, "ioctl", "a GPIO line that permits torque: set where it changes, read once a tick"},
    DeclaredSyscall{SYS_fcntl, "fcntl", "the same where a locked file is in its place"},
    DeclaredSyscall{SYS_newfstatat, "newfstatat", "the same: is it still there"},
    DeclaredSyscall{SYS_fstat, "fstat", "the same, by another C library"},
    DeclaredSyscall{SYS_getrusage, "getrusage", "evidence: switches and faults of the thread"},
};

}  // namespace takt::runtime
