// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/status_board.hpp"

#include <cstring>
#include <new>
#include <span>

namespace takt::runtime {
namespace {

constexpr std::align_val_t kAlignment{64};

constexpr ipc::RingShape shape() {
  return {ipc::kMailboxSlots, sizeof(StatusSnapshot), layout_of<StatusSnapshot>()};
}

std::byte* zeroed_ring() {
  auto* const memory = static_cast<std::byte*>(::operator new(ipc::ring_bytes(shape()), kAlignment));
  std::memset(memory, 0, ipc::ring_bytes(shape()));
  return memory;
}

}  // namespace

void StatusBoard::Free::operator()(std::byte* memory) const noexcept {
  ::operator delete(memory, kAlignment);
}

StatusBoard::StatusBoard()
    : memory_(zeroed_ring()),
      writer_({memory_.get(), ipc::ring_bytes(shape())}, shape()),
      reader_(ipc::SlotReader::attach({memory_.get(), ipc::ring_bytes(shape())}, shape()).value()) {}

void StatusBoard::publish(const StatusSnapshot& status) noexcept {
  writer_.publish(std::as_bytes(std::span(&status, 1)));
}

const StatusSnapshot& StatusBoard::read() noexcept {
  if (reader_.read_latest(std::as_writable_bytes(std::span(&candidate_, 1))).status == ipc::ReadStatus::fresh) {
    latest_ = candidate_;
  }
  return latest_;
}

}  // namespace takt::runtime
