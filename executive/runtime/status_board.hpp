// SPDX-License-Identifier: Apache-2.0
// The loop's state for the service thread: the control thread publishes it every tick, the service thread reads the
// newest. The same versioned slots as between processes, in ordinary memory. Thread rules: publish() control thread,
// read() service.
#pragma once

#include <cstddef>
#include <memory>

#include "executive/contract/session.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::runtime {

class StatusBoard {
 public:
  StatusBoard();
  void publish(const StatusSnapshot& status) noexcept;
  // The newest complete snapshot; the one before when the writer was faster every time. All zero before the first.
  const StatusSnapshot& read() noexcept;

 private:
  struct Free {
    void operator()(std::byte* memory) const noexcept;
  };
  std::unique_ptr<std::byte, Free> memory_;
  ipc::SlotWriter writer_;
  ipc::SlotReader reader_;
  StatusSnapshot latest_;
  StatusSnapshot candidate_;
};

}  // namespace takt::runtime
