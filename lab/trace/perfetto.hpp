// SPDX-License-Identifier: Apache-2.0
// A trace as Trace Event JSON, which ui.perfetto.dev and chrome://tracing open: a track per process with its spans, an
// arrow through each command's way over the processes, counters for age and wake-up latency, a mark at each change of
// mode. Times in us of CLOCK_MONOTONIC. Format: "Trace Event Format", Google. Pure.
#pragma once

#include <functional>
#include <string_view>

#include "lab/trace/command_chain.hpp"

namespace takt::lab {

// Hands out the text piece by piece: a long trace is larger than it should be in memory.
void write_perfetto(const Timeline& timeline, const Chains& chains, std::int64_t executive_pid,
                    const std::function<void(std::string_view)>& write);

}  // namespace takt::lab
