// SPDX-License-Identifier: Apache-2.0
// Takt's processes on this machine, and which of them a session daemon knows: what waiting for a trace to begin needs.
#pragma once

#include <sys/types.h>

#include <string>
#include <string_view>
#include <vector>

namespace takt::cli {

struct TraceableProcess {
  pid_t pid = 0;
  std::string program;  // "takt-executive"
};

// Those that carry trace points and whose program file we may see: all of them as root, else our own.
std::vector<TraceableProcess> traceable_processes();

// Whether `lttng list --userspace`, which printed `listing`, names this process: from then on it is traced.
bool is_registered(std::string_view listing, pid_t pid);

}  // namespace takt::cli
