// SPDX-License-Identifier: Apache-2.0
// Up to kBatch waiting messages of a CAN-like socket, fetched with one recvmmsg and without allocation.
// Thread rule: one thread at a time. Never waits.
#pragma once

#include <linux/can.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <array>
#include <cstddef>

#include "drivers/bus/receive_stamp.hpp"

namespace takt::drivers {

class MessageBatch {
 public:
  static constexpr std::size_t kBatch = 32;

  struct Result {
    std::size_t count = 0;
    int error = 0;  // errno when nothing was fetched; 0: fetched something, or nothing waits
  };
  Result fetch(int socket, std::size_t at_most) noexcept;

  // Of the last fetch, index < count. Bytes beyond size() are zero.
  [[nodiscard]] const canfd_frame& frame(std::size_t index) const { return frames_[index]; }
  [[nodiscard]] std::size_t size(std::size_t index) const { return messages_[index].msg_len; }
  // A frame of this very socket, handed back by the controller that put it on the wire.
  [[nodiscard]] bool is_own(std::size_t index) const { return (messages_[index].msg_hdr.msg_flags & MSG_CONFIRM) != 0; }
  [[nodiscard]] ControlMessages control(std::size_t index) const;

 private:
  struct alignas(cmsghdr) Control {
    std::array<char, 128> bytes{};
  };
  std::array<canfd_frame, kBatch> frames_{};
  std::array<iovec, kBatch> vectors_{};
  std::array<Control, kBatch> controls_{};
  std::array<mmsghdr, kBatch> messages_{};
};

}  // namespace takt::drivers
