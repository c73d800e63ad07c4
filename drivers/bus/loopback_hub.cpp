// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/loopback_hub.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "drivers/bus/can_frame.hpp"
#include "drivers/bus/error_frame.hpp"
#include "drivers/bus/loopback_socket.hpp"

namespace takt::drivers {
namespace {

bool watch(int poll, int socket) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.fd = socket;
  return ::epoll_ctl(poll, EPOLL_CTL_ADD, socket, &event) == 0;
}

bool someone_answers(const sockaddr_storage& address) {
  const FileHandle probe = open_loopback_socket();
  return ::connect(probe.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(sockaddr_un)) == 0 ||
         errno == EAGAIN;
}

std::expected<FileHandle, std::string> bind_listener(const std::string& path) {
  const auto named = loopback_address(path);
  if (!named) return std::unexpected(named.error());
  sockaddr_storage address{};
  std::memcpy(&address, &*named, sizeof *named);
  std::error_code ignored;  // bind() says what is wrong with the directory
  std::filesystem::create_directories(std::filesystem::path(path).parent_path(), ignored);
  if (someone_answers(address))
    return std::unexpected(path + ": another hub serves this bus already: stop that takt-plant first");
  ::unlink(path.c_str());
  FileHandle listener = open_loopback_socket();
  if (!listener.is_open() ||
      ::bind(listener.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(sockaddr_un)) != 0 ||
      ::chmod(path.c_str(), S_IRUSR | S_IWUSR) != 0 || ::listen(listener.get(), 8) != 0)
    return std::unexpected("loopback hub cannot listen at " + path + " (" + std::strerror(errno) +
                           "): choose a writable --runtime-dir");
  return listener;
}

}  // namespace

std::expected<std::unique_ptr<LoopbackHub>, std::string> LoopbackHub::listen(const std::string& socket_path,
                                                                             const BusOptions& own_node) {
  std::expected<FileHandle, std::string> listener = bind_listener(socket_path);
  if (!listener) return std::unexpected(listener.error());
  FileHandle poll(::epoll_create1(EPOLL_CLOEXEC));
  if (!poll.is_open() || !watch(poll.get(), listener->get()))
    return std::unexpected(socket_path + ": no epoll to be had (" + std::strerror(errno) + ")");
  return std::unique_ptr<LoopbackHub>(new LoopbackHub(std::move(*listener), std::move(poll), socket_path, own_node));
}

LoopbackHub::LoopbackHub(FileHandle listener, FileHandle poll, std::string path, const BusOptions& own_node)
    : listener_(std::move(listener)), poll_(std::move(poll)), path_(std::move(path)), filter_(own_node.receive) {
  nodes_.reserve(kMaxNodes);
}

LoopbackHub::~LoopbackHub() {
  ::unlink(path_.c_str());
}

SendResult LoopbackHub::send(const CanFrame& frame) noexcept {
  if (!faults_.drop_to_nodes && !is_off()) pass_on(to_kernel(frame), -1);
  return SendResult::sent;
}

void LoopbackHub::report_error_state(BusState state) noexcept {
  if (state == BusState::down) return;
  health_.state = state;
  pass_on(to_kernel(make_error_frame({.state = state})), -1);
}

void LoopbackHub::report_receive_overflow() noexcept {
  pass_on(to_kernel(make_error_frame({.overflowed = true})), -1);
}

void LoopbackHub::lose(int from) noexcept {
  if (!faults_.refuse_transmit || is_off()) return;
  const canfd_frame told = to_kernel(make_error_frame({.frame_lost = true}));
  if (write_frame(from, told) == FrameOut::full) ++health_.tx_dropped;
}

std::size_t LoopbackHub::receive(std::span<ReceivedFrame> out) noexcept {
  return serve_ready(0, out);
}

std::size_t LoopbackHub::pump(Duration timeout) noexcept {
  std::array<ReceivedFrame, MessageBatch::kBatch> unread;
  return serve_ready(static_cast<int>(timeout.ns / 1'000'000), unread);
}

std::size_t LoopbackHub::serve_ready(int timeout_ms, std::span<ReceivedFrame> out) noexcept {
  std::array<epoll_event, kMaxNodes + 1> ready{};
  const int count = ::epoll_wait(poll_.get(), ready.data(), static_cast<int>(ready.size()), timeout_ms);
  std::size_t filled = 0;
  for (int i = 0; i < count; ++i) {
    const int socket = ready[static_cast<std::size_t>(i)].data.fd;
    if (socket == listener_.get())
      accept_nodes();
    else if (!faults_.stalled)
      filled += serve(socket, out.subspan(filled));
  }
  return filled;
}

std::size_t LoopbackHub::serve(int socket, std::span<ReceivedFrame> out) noexcept {
  const std::size_t room = std::min(out.size(), MessageBatch::kBatch);
  if (room == 0) return 0;
  const MessageBatch::Result fetched = batch_.fetch(socket, room);
  const ClockPair clocks = sample_clocks();
  std::size_t filled = 0;
  for (std::size_t i = 0; i < fetched.count; ++i) {
    const std::optional<ReceivedFrame> received = frame_of(batch_, i, clocks);
    if (!received || received->frame.error) {  // end of stream, or not a frame
      disconnect(socket);
      return filled;
    }
    if (is_off() || faults_.drop_from_nodes || faults_.refuse_transmit) {
      lose(socket);
      continue;
    }
    pass_on(batch_.frame(i), socket);
    if (filter_.wants(received->frame)) out[filled++] = *received;
  }
  if (fetched.error != 0) disconnect(socket);
  return filled;
}

void LoopbackHub::pass_on(const canfd_frame& frame, int from) noexcept {
  // A node that is gone is found on reading, so that the list does not change under this loop.
  for (const FileHandle& node : nodes_)
    if (node.get() != from && write_frame(node.get(), frame) == FrameOut::full) ++health_.tx_dropped;
}

void LoopbackHub::accept_nodes() noexcept {
  for (std::size_t turn = 0; turn <= kMaxNodes; ++turn) {
    FileHandle node(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!node.is_open()) return;
    if (nodes_.size() == kMaxNodes || !watch(poll_.get(), node.get())) continue;  // closed: connection refused
    ask_for_stamps(node.get());
    nodes_.push_back(std::move(node));
  }
}

void LoopbackHub::disconnect(int socket) noexcept {
  std::erase_if(nodes_, [socket](const FileHandle& node) { return node.get() == socket; });
}

}  // namespace takt::drivers
