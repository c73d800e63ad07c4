// SPDX-License-Identifier: Apache-2.0
// Writes down what a trace's flight recorder remembers: takt trace snapshot, for other commands.
#pragma once

#include <expected>
#include <string>

#include "cli/command.hpp"

namespace takt::cli {

// `output`: folder to write into; empty: the one given when the trace was started. Returns the folder. Runs lttng and
// waits for it: up to seconds.
std::expected<std::string, Refusal> trace_snapshot(const std::string& output);

}  // namespace takt::cli
