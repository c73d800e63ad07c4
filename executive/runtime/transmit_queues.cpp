// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/transmit_queues.hpp"

#include <spdlog/spdlog.h>

#include "drivers/bus/transmit_queue.hpp"

namespace takt::runtime {

void TransmitQueues::serve(MonoTime now) {
  const BusMask overdue = watch_.overdue(now);
  if (overdue == 0) return;
  for (std::size_t bus = 0; bus < interfaces_.size(); ++bus) {
    if ((overdue >> bus & 1U) == 0) continue;
    const auto purged = drivers::purge_transmit_queue(interfaces_[bus]);
    if (purged)
      spdlog::warn("{}: the bus carries nothing: its queue was emptied before a setpoint in it got too old",
                   interfaces_[bus]);
    else
      spdlog::error("{}: a setpoint older than freshness.max_age may leave when the bus returns: {}", interfaces_[bus],
                    purged.error());
  }
}

}  // namespace takt::runtime
