// SPDX-License-Identifier: Apache-2.0
// The log of a program that runs for long: spdlog's default logger onto standard error, through a queue
// (line_queue.hpp), so that logging never blocks the caller; and SIGPIPE ignored, so that a reader who leaves ends
// no program. Instants are UTC. Lines to the journal begin with their priority, for `journalctl -p`.
#pragma once

#include <string>

namespace takt::log {

// Call once, before the first line, from the only thread there is. spdlog's flush() waits kLastWords at most.
void log_to_stderr(const std::string& program);

}  // namespace takt::log
