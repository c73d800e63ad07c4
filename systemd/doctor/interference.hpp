// SPDX-License-Identifier: Apache-2.0
// Reads how often something took a processor away without the kernel's doing: system management interrupts (the
// firmware's; Intel's processors count them, and the msr driver shows the count) and time that a hypervisor gave to
// others ("steal"); and how busy the other cores were, without which a punctual machine proves little. Counts since the
// machine started, in steps of 10 ms for the time; read before and after a measurement, they tell what happened within
// it. They do not say when, nor how long an SMI took: hwlatdetect (rt-tests) does. Nothing here fails; thread rule: any
// thread.
#pragma once

#include <optional>
#include <string>

#include "systemd/doctor/snapshot.hpp"

namespace takt::doctor {

// `root`: before /dev and /proc; empty, but for tests. `cpu` absent: SMIs as core 0 counts them, time stolen from all
// cores.
Interference read_interference(const std::string& root, std::optional<int> cpu);

// What came between the two; counted only where both were.
Interference interference_between(const Interference& before, const Interference& after);

}  // namespace takt::doctor
