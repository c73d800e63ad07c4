// SPDX-License-Identifier: Apache-2.0
// Any request at /metrics: at most one answer of known kinds, of the length that it says, and the page for nothing but
// a GET of its path. Any answer of an OTLP receiver: the request is settled or tried again, and an answer that is no
// HTTP delivers nothing.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <strings.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <thread>

#include "monitor/telemetry/otlp_sender.hpp"
#include "monitor/telemetry/scrape_server.hpp"
#include "tests/fuzz/peer.hpp"
#include "tests/fuzz/source.hpp"

namespace {

using namespace takt;
using namespace takt::monitor;
using fuzz::require;
using fuzz::Source;

constexpr std::string_view kPage = "takt_up 1\n";

sockaddr_in loopback(std::uint32_t last, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(0x7F000000U + last);
  return address;
}

ipc::Descriptor bound(std::uint32_t last) {
  ipc::Descriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const sockaddr_in address = loopback(last, 0);
  require(::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  return socket;
}

std::uint16_t port_of(const ipc::Descriptor& socket) {
  sockaddr_in address{};
  socklen_t length = sizeof address;
  require(::getsockname(socket.get(), reinterpret_cast<sockaddr*>(&address), &length) == 0);
  return ntohs(address.sin_port);
}

std::string received(int socket) {
  std::string all;
  std::array<char, 4096> piece{};
  for (ssize_t got = 0; (got = ::recv(socket, piece.data(), piece.size(), 0)) > 0;)
    all.append(piece.data(), static_cast<std::size_t>(got));
  return all;
}

// --- /metrics ---

std::atomic<int> g_pages = 0;

// Serves until the process ends.
std::uint16_t served_port() {
  static const std::uint16_t port = [] {
    const std::uint16_t free = port_of(bound(1));
    auto server = ScrapeServer::listen("127.0.0.1", free, "/metrics", "text/plain", [] {
      ++g_pages;
      return std::string(kPage);
    });
    require(server.has_value());
    std::thread([one = std::move(*server)]() mutable {
      one.serve(ipc::Descriptor(::eventfd(0, EFD_CLOEXEC)));
    }).detach();
    return free;
  }();
  return port;
}

// One whole answer, or none; returns its status.
int status_of(std::string_view answer) {
  if (answer.empty()) return 0;
  constexpr std::string_view kVersion = "HTTP/1.1 ", kLength = "\r\nContent-Length: ";
  const std::size_t head = answer.find("\r\n\r\n"), length = answer.find(kLength);
  require(answer.starts_with(kVersion) && head != std::string_view::npos && length < head);
  int status = 0;
  std::size_t bytes = 0;
  std::from_chars(answer.data() + kVersion.size(), answer.data() + head, status);
  std::from_chars(answer.data() + length + kLength.size(), answer.data() + head, bytes);
  require(answer.size() - head - 4 == bytes);
  return status;
}

void scrape(Source& source) {
  const int pages = g_pages;
  const std::size_t pieces = 1U + source.byte() % 3U;
  const std::string request = source.text(2 * kMostRequestBytes);
  const std::uint16_t port = served_port();
  static std::uint32_t from = 0;  // many addresses, for each closed connection keeps its port for a minute
  const ipc::Descriptor client = bound(1U + ++from % 200U);
  const sockaddr_in server = loopback(1, port);
  require(::connect(client.get(), reinterpret_cast<const sockaddr*>(&server), sizeof server) == 0);
  for (std::size_t at = 0; at < request.size(); at += request.size() / pieces + 1)
    (void)::send(client.get(), &request[at], std::min(request.size() / pieces + 1, request.size() - at), MSG_NOSIGNAL);
  ::shutdown(client.get(), SHUT_WR);
  const std::string answer = received(client.get());
  const int status = status_of(answer);
  require(status == 0 || status == 200 || status == 400 || status == 404 || status == 405 || status == 431);
  require(g_pages - pages == (status == 200 ? 1 : 0));
  if (status == 200) require(request.starts_with("GET /metrics") && answer.ends_with(kPage));
  if (request == "GET /metrics HTTP/1.1\r\n\r\n") require(status == 200);
}

// --- an OTLP receiver ---

bool hears_a_request(int socket) {
  std::string request;
  std::array<char, 4096> piece{};
  while (!request.ends_with("\r\n\r\n{}")) {
    const ssize_t got = ::recv(socket, piece.data(), piece.size(), 0);
    if (got <= 0) return false;
    request.append(piece.data(), static_cast<std::size_t>(got));
  }
  return true;
}

// The input answers the first try, and a second one finds a receiver that takes everything.
void deliver(Source& source) {
  const bool is_long = source.byte() % 8 == 0;
  std::string answer = source.text(4096);
  if (is_long) answer.append(70'000, answer.empty() ? 'x' : answer.back());
  // It waits then for as long as it was told, but for its end.
  const bool may_tell_to_wait = answer.contains('-');
  std::atomic<int> tries = 0;
  {
    ipc::Descriptor listener = bound(1);
    require(::listen(listener.get(), 8) == 0);
    const std::string endpoint = "http://127.0.0.1:" + std::to_string(port_of(listener));
    const fuzz::Peer receiver(std::move(listener), [&](int socket) {
      if (!hears_a_request(socket)) return;
      const std::string said = ++tries == 1 ? answer : "HTTP/1.1 200 OK\r\nContent-Length: 0\r\n\r\n";
      (void)::send(socket, said.data(), said.size(), MSG_NOSIGNAL);
      ::shutdown(socket, SHUT_WR);
      (void)received(socket);
    });
    OtlpSender sender(endpoint, {.first = std::chrono::milliseconds(1), .longest = std::chrono::milliseconds(2)});
    sender.post(OtlpSignal::metrics, "{}");
    while (tries == 0 || (!may_tell_to_wait && sender.deliveries().delivered + sender.deliveries().refused == 0))
      std::this_thread::sleep_for(std::chrono::microseconds(50));
  }
  require(tries == 1 || tries == 2);
  const bool is_http =
      ::strncasecmp(answer.c_str(), "HTTP/", 5) == 0;  // as libcurl takes it; of another status: refused
  if (!is_http && !is_long) require(tries == 2);
  if (answer.starts_with("HTTP/1.1 200 OK\r\nContent-Length: 0\r\n\r\n") && !is_long) require(tries == 1);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Source source({data, size});
  source.byte() % 4 == 0 ? deliver(source) : scrape(source);
  return 0;
}
