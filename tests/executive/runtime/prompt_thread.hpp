// SPDX-License-Identifier: Apache-2.0
// For threads that stand in for hardware or for another process: a low real-time priority where the machine grants it,
// so that a busy machine does not starve them. They sleep in every round. Without the right to it they run as they are.
#pragma once

#include <sched.h>

namespace takt::runtime::test {

inline void make_this_thread_prompt() {
  const sched_param low{.sched_priority = 5};
  sched_setscheduler(0, SCHED_FIFO, &low);
}

}  // namespace takt::runtime::test
