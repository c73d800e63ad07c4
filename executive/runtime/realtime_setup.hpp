// SPDX-License-Identifier: Apache-2.0
// What makes the control thread punctual, step by step, each with a result that names what to correct.
//
// Essential steps: locked memory, SCHED_FIFO, affinity. Without them the executive refuses to
// start unless told --allow-non-realtime, and then its status and every artifact say so. The other steps improve
// latency; a failure is reported, and costs nothing else. Sources: sched(7), mlockall(2), mallopt(3), prctl(2)
// PR_SET_TIMERSLACK, Documentation/power/pm_qos_interface. Thread rule: set-up, before the first tick.
#pragma once

#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/ipc/descriptor.hpp"

namespace takt::runtime {

struct SetupStep {
  std::string name;  // stable: appears in executive.json and in the run's manifest
  bool ok = false;
  bool essential = false;
  std::string detail;  // what was achieved; or why not, and how to correct it
};

struct ProcessSetup {
  std::vector<SetupStep> steps;
  ipc::Descriptor cpu_dma_latency;  // the request holds for as long as this is open
};

// Whole process: limits, allocator, locked memory, processor sleep states, the kernel's real-time throttling.
ProcessSetup prepare_process(const config::Control& control);
// The calling thread: stack, timer slack, affinity, SCHED_FIFO.
std::vector<SetupStep> prepare_thread(const config::Control& control);

// No essential step failed.
bool is_realtime(const std::vector<SetupStep>& steps);

}  // namespace takt::runtime
