// SPDX-License-Identifier: Apache-2.0
// The recorded ticks of a run, as much of each as the review of a trace compares.
#pragma once

#include <expected>
#include <string>
#include <vector>

#include "lab/trace/record_check.hpp"

namespace takt::lab {

// Ascending by tick. The error is one sentence.
std::expected<std::vector<TickFacts>, std::string> records_of(const std::string& run_directory);

}  // namespace takt::lab
