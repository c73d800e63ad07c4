// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/loopback_bus.hpp"

#include <sys/socket.h>

#include <cerrno>
#include <cstring>

#include "drivers/bus/can_frame.hpp"
#include "drivers/bus/error_frame.hpp"
#include "drivers/bus/loopback_socket.hpp"

namespace takt::drivers {
namespace {

// Batches per receive() call: bounds the work when foreign frames flood the bus.
constexpr int kLoopbackBatchesPerCall = 4;

}  // namespace

std::expected<std::unique_ptr<LoopbackBus>, std::string> LoopbackBus::connect(const std::string& socket_path,
                                                                              const BusOptions& options) {
  const auto address = loopback_address(socket_path);
  if (!address) return std::unexpected(address.error());
  FileHandle socket = open_loopback_socket();
  ask_for_stamps(socket.get());
  sockaddr_storage any{};
  std::memcpy(&any, &*address, sizeof *address);
  if (!socket.is_open() || ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&any), sizeof *address) != 0)
    return std::unexpected("loopback bus " + options.interface + ": no hub answers at " + socket_path + " (" +
                           std::strerror(errno) + "): start takt-plant with the same --runtime-dir first");
  return std::unique_ptr<LoopbackBus>(new LoopbackBus(std::move(socket), options));
}

SendResult LoopbackBus::send(const CanFrame& frame) noexcept {
  if (health_.state == BusState::down) return SendResult::bus_down;
  if (drops_while_off(health_)) return SendResult::bus_down;
  switch (write_frame(socket_.get(), to_kernel(frame))) {
    case FrameOut::sent:
      return SendResult::sent;
    case FrameOut::full:
      ++health_.tx_dropped;
      return SendResult::queue_full;
    case FrameOut::closed:
      break;
  }
  health_.state = BusState::down;
  return SendResult::bus_down;
}

std::size_t LoopbackBus::receive(std::span<ReceivedFrame> out) noexcept {
  std::size_t filled = 0;
  for (int batch = 0; batch < kLoopbackBatchesPerCall && filled < out.size() && health_.state != BusState::down;
       ++batch) {
    const std::size_t wanted = std::min(out.size() - filled, MessageBatch::kBatch);
    const MessageBatch::Result fetched = batch_.fetch(socket_.get(), wanted);
    if (fetched.error != 0) health_.state = BusState::down;
    filled += take(fetched.count, out.subspan(filled));
    if (fetched.count < wanted) break;
  }
  return filled;
}

std::size_t LoopbackBus::take(std::size_t fetched, std::span<ReceivedFrame> out) noexcept {
  if (fetched == 0) return 0;
  const ClockPair clocks = sample_clocks();
  std::size_t filled = 0;
  for (std::size_t i = 0; i < fetched; ++i) {
    if (batch_.size(i) == 0) {  // end of stream
      health_.state = BusState::down;
      break;
    }
    const std::optional<ReceivedFrame> received = frame_of(batch_, i, clocks);
    if (!received) continue;
    if (received->frame.error)
      note_error_frame(received->frame, health_);
    else if (filter_.wants(received->frame))
      out[filled++] = *received;
  }
  return filled;
}

}  // namespace takt::drivers
