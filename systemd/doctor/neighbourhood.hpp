// SPDX-License-Identifier: Apache-2.0
// Reads what else may take the control core or slow it down. What is absent stays empty; nothing fails. Thread rule:
// any.
#pragma once

#include <string>

#include "systemd/doctor/snapshot.hpp"

namespace takt::doctor {

// `root`: before /proc, /sys and /etc; empty, but for tests.
Neighbourhood read_neighbourhood(const std::string& root, int control_cpu);

// "f,00000003" as the kernel writes masks of processors, 32 bits a group, most significant first.
std::vector<int> cpu_mask(const std::string& text);

}  // namespace takt::doctor
