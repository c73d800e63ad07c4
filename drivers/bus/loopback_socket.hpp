// SPDX-License-Identifier: Apache-2.0
// What both ends of a loopback connection share: address, socket, one frame out.
#pragma once

#include <sys/un.h>

#include <expected>
#include <optional>
#include <string>

#include "drivers/bus/can_bus.hpp"
#include "drivers/bus/file_handle.hpp"
#include "drivers/bus/message_batch.hpp"

namespace takt::drivers {

std::expected<sockaddr_un, std::string> loopback_address(const std::string& path);
FileHandle open_loopback_socket();
void ask_for_stamps(int socket);  // SO_TIMESTAMPNS

enum class FrameOut : std::uint8_t { sent, full, closed };
FrameOut write_frame(int socket, const canfd_frame& frame) noexcept;

// Message `index` of a batch as a frame (perhaps an error frame) with its stamp; nothing when it is no canfd_frame.
std::optional<ReceivedFrame> frame_of(const MessageBatch& batch, std::size_t index, const ClockPair& clocks) noexcept;

}  // namespace takt::drivers
