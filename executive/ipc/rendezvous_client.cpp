// SPDX-License-Identifier: Apache-2.0
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "executive/contract/contract_layout.hpp"
#include "executive/ipc/hello_check.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/stop_line.hpp"
#include "executive/ipc/unix_socket.hpp"

namespace takt::ipc {
namespace {

using Clock = std::chrono::steady_clock;

std::string connect_fault(const std::string& path) {
  switch (errno) {
    case ENOENT:
    case ECONNREFUSED:
      if (path.substr(path.rfind('/') + 1).starts_with("sensor-"))
        return "rendezvous: no process publishes at " + path +
               ": start the sensor's own program, with the robot's --runtime-dir";
      return "rendezvous: no process listens at " + path + ": start the robot first, or check --runtime-dir";
    case EACCES:
      return "rendezvous: no permission to connect to " + path + ": run as the server's user or root";
    case EAGAIN:
      return "rendezvous: the server at " + path + " accepts no connection: it hangs or is overloaded";
    default:
      return "rendezvous: cannot connect to " + path + ": " + errno_text();
  }
}

std::expected<Descriptor, std::string> connect_within(const std::string& path, std::chrono::milliseconds timeout) {
  if (auto checked = check_path(path); !checked) return std::unexpected(checked.error());
  Descriptor socket = open_seqpacket();
  const auto seconds = std::chrono::floor<std::chrono::seconds>(timeout);
  // Zero would mean "wait for ever".
  const auto rest = std::max(std::chrono::microseconds(timeout - seconds), std::chrono::microseconds(1));
  const timeval limit{.tv_sec = seconds.count(), .tv_usec = rest.count()};
  if (!socket.is_open() || setsockopt(socket.get(), SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit) != 0) {
    return std::unexpected("rendezvous: cannot open a socket: " + errno_text());
  }
  while (!connect_to(socket, path)) {
    if (errno != EINTR) return std::unexpected(connect_fault(path));
  }
  return socket;
}

// Waits for a message until the deadline. False: none came.
bool wait_for_message(int socket, Clock::time_point deadline) {
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
    pollfd polled{socket, POLLIN, 0};
    const int ready = poll(&polled, 1, static_cast<int>(std::max<std::int64_t>(left.count(), 0)));
    if (ready > 0) return true;
    if (ready == 0 || errno != EINTR) return false;
  }
}

// A message of exactly the type's size and with its magic number, or the sentence that says what came instead.
template <class Message>
std::expected<std::vector<Descriptor>, std::string> receive(const Descriptor& socket, Message& message,
                                                            Clock::time_point deadline, const std::string& path) {
  if (!wait_for_message(socket.get(), deadline)) {
    return std::unexpected("rendezvous: the server at " + path + " did not answer in time: it hangs or is overloaded");
  }
  Received received = receive_message(socket.get(), std::as_writable_bytes(std::span(&message, 1)), MSG_DONTWAIT);
  if (received.size <= 0) {
    return std::unexpected("rendezvous: the server at " + path + " closed the connection without an answer");
  }
  if (received.size != sizeof message || message.magic != kMagic) {
    return std::unexpected("rendezvous: the server at " + path +
                           " gave an answer that is not Takt's: install the same version on both sides");
  }
  return std::move(received.descriptors);
}

// Says hello and takes the welcome.
std::expected<Lease, std::string> attach_until(const std::string& path, Hello hello, std::chrono::milliseconds timeout,
                                               Clock::time_point deadline) {
  auto socket = connect_within(path, timeout);
  if (!socket) return std::unexpected(socket.error());
  if (hello.layout == 0) hello.layout = contract_layout();
  // A server that is full refuses before it reads: even when this fails, its sentence may be waiting.
  send_message(socket->get(), std::as_bytes(std::span(&hello, 1)), {});
  Welcome welcome;
  auto descriptors = receive(*socket, welcome, deadline, path);
  if (!descriptors) return std::unexpected(descriptors.error());
  if (welcome.status != WelcomeStatus::accepted) {
    make_printable(welcome.sentence);
    if (welcome.sentence[0] == '\0')
      return std::unexpected("rendezvous: the server at " + path + " refuses, and does not say why: see its log");
    return std::unexpected(welcome.sentence);
  }
  if (descriptors->size() != welcome.descriptor_count) {
    return std::unexpected("rendezvous: " + std::to_string(descriptors->size()) + " of " +
                           std::to_string(welcome.descriptor_count) +
                           " descriptors arrived: raise the open-file limit (ulimit -n)");
  }
  return Lease{std::move(*socket), std::move(*descriptors), welcome.lockstep != 0};
}

}  // namespace

std::expected<Lease, std::string> attach(const std::string& path, const Hello& hello,
                                         std::chrono::milliseconds timeout) {
  return attach_until(path, hello, timeout, Clock::now() + timeout);
}

std::expected<void, std::string> acknowledge(const Lease& lease) {
  const std::byte mapped{1};
  if (send_message(lease.connection.get(), std::span(&mapped, 1), {})) return {};
  return std::unexpected("rendezvous: cannot acknowledge: " + errno_text() + ": attach again");
}

void tell_recorded(const Lease& lease, std::uint64_t through_tick) {
  RecorderWord word;
  word.through_tick = through_tick;
  (void)send(lease.connection.get(), &word, sizeof word, MSG_DONTWAIT | MSG_NOSIGNAL);
}

void tell(const Lease& lease, PolicyWordKind kind, std::string_view sentence, std::uint64_t first_sequence) {
  PolicyWord word;
  word.kind = kind;
  word.first_sequence = first_sequence;
  sentence.copy(word.sentence, sizeof word.sentence - 1);
  (void)send(lease.connection.get(), &word, sizeof word, MSG_DONTWAIT | MSG_NOSIGNAL);
}

std::optional<std::variant<PolicyWord, OperatorWord>> next_word(const Lease& lease) {
  std::array<std::byte, std::max(sizeof(PolicyWord), sizeof(OperatorWord))> bytes;
  static_assert(sizeof(PolicyWord) != sizeof(OperatorWord));
  const ssize_t size = recv(lease.connection.get(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_TRUNC);
  if (size == sizeof(OperatorWord)) {
    OperatorWord word;
    std::memcpy(&word, bytes.data(), sizeof word);
    if (word.magic != kMagic) return std::nullopt;
    make_printable(word.program);
    make_printable(word.answer);
    return word;
  }
  PolicyWord word;
  std::memcpy(&word, bytes.data(), sizeof word);
  if (!fault_in(word, size).empty()) return std::nullopt;
  make_printable(word.sentence);
  return word;
}

bool is_over(const Lease& lease) {
  std::byte ignored{};
  const ssize_t size = recv(lease.connection.get(), &ignored, 1, MSG_PEEK | MSG_DONTWAIT);
  return size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR);
}

std::expected<OperatorReply, std::string> ask(const std::string& path, OperatorVerb verb,
                                              std::chrono::milliseconds timeout, std::uint64_t policy_hash,
                                              std::string_view text) {
  const Clock::time_point deadline = Clock::now() + timeout;
  const bool handed_over = is_stop(verb) && hand_over_stop(stop_socket_beside(path), verb);
  const auto failed = [handed_over](const std::string& why) {
    return std::unexpected(handed_over ? "the stop was handed over, but no answer came: " + why : why);
  };
  Hello hello;
  hello.role = Role::operator_console;
  auto lease = attach_until(path, hello, timeout, deadline);
  if (!lease) return failed(lease.error());
  OperatorMessage message;
  message.verb = verb;
  message.policy_hash = policy_hash;
  std::array<std::byte, sizeof message + kLongestMark> bytes{};
  text = text.substr(0, kLongestMark);
  std::memcpy(bytes.data(), &message, sizeof message);
  if (!text.empty()) std::memcpy(bytes.data() + sizeof message, text.data(), text.size());
  send_message(lease->connection.get(), std::span(bytes).first(sizeof message + text.size()), {});
  OperatorReply reply;
  if (auto received = receive(lease->connection, reply, deadline, path); !received) {
    return failed(received.error());
  }
  return reply;
}

}  // namespace takt::ipc
