// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/message_batch.hpp"

#include <algorithm>
#include <cerrno>

namespace takt::drivers {

MessageBatch::Result MessageBatch::fetch(int socket, std::size_t at_most) noexcept {
  const std::size_t wanted = std::min(at_most, kBatch);
  for (std::size_t i = 0; i < wanted; ++i) {
    frames_[i] = {};
    vectors_[i] = {&frames_[i], sizeof frames_[i]};
    messages_[i] = {};
    messages_[i].msg_hdr.msg_iov = &vectors_[i];
    messages_[i].msg_hdr.msg_iovlen = 1;
    messages_[i].msg_hdr.msg_control = controls_[i].bytes.data();
    messages_[i].msg_hdr.msg_controllen = controls_[i].bytes.size();
  }
  const int got = ::recvmmsg(socket, messages_.data(), static_cast<unsigned>(wanted), MSG_DONTWAIT, nullptr);
  if (got >= 0) return {static_cast<std::size_t>(got), 0};
  return {0, errno == EAGAIN || errno == EINTR ? 0 : errno};
}

ControlMessages MessageBatch::control(std::size_t index) const {
  return read_control_messages(messages_[index].msg_hdr);
}

}  // namespace takt::drivers
