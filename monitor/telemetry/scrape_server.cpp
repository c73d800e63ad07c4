// SPDX-License-Identifier: Apache-2.0
#include "monitor/telemetry/scrape_server.hpp"

#include <fmt/format.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>

namespace takt::monitor {
namespace {

constexpr int kLook_ms = 100;  // how often deadlines are looked at

std::string closing(std::string_view status, std::string_view type, std::string_view body) {
  return fmt::format("HTTP/1.1 {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{}", status,
                     type, body.size(), body);
}

std::string refusal(std::string_view status) {
  return closing(status, "text/plain", fmt::format("{}\n", status));
}

bool is_complete(std::string_view request) {
  return request.contains("\r\n\r\n") || request.contains("\n\n");
}

}  // namespace

std::expected<ScrapeServer, std::string> ScrapeServer::listen(const std::string& address, std::uint16_t port,
                                                              std::string path, std::string_view content_type,
                                                              std::function<std::string()> page) {
  addrinfo wanted{};
  wanted.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* first = nullptr;
  if (const int error = getaddrinfo(address.c_str(), std::to_string(port).c_str(), &wanted, &first); error != 0)
    return std::unexpected(gai_strerror(error));
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> found(first, freeaddrinfo);
  int error = 0;
  for (const addrinfo* each = found.get(); each != nullptr; each = each->ai_next) {
    ipc::Descriptor socket(::socket(each->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    // Not SO_REUSEPORT, with which two monitors would share one port and take turns.
    const int yes = 1;
    setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (socket.is_open() && bind(socket.get(), each->ai_addr, each->ai_addrlen) == 0 &&
        ::listen(socket.get(), static_cast<int>(kMostConnections)) == 0)
      return ScrapeServer(std::move(socket), std::move(path), content_type, std::move(page));
    error = errno;
  }
  return std::unexpected(std::strerror(error));
}

void ScrapeServer::serve(const ipc::Descriptor& stop) {
  while (true) {
    std::array<pollfd, kMostConnections + 2> looked{};
    looked[0] = {stop.get(), POLLIN, 0};
    looked[1] = {listener_.get(), POLLIN, 0};
    for (std::size_t i = 0; i < kMostConnections; ++i) {
      const Connection& each = connections_[i];
      looked[i + 2] = {each.socket.get(), static_cast<short>(each.answer.empty() ? POLLIN : POLLOUT), 0};
    }
    (void)poll(looked.data(), looked.size(), kLook_ms);
    if ((looked[0].revents & POLLIN) != 0) return;
    const auto now = Clock::now();
    for (std::size_t i = 0; i < kMostConnections; ++i) {
      Connection& each = connections_[i];
      if (!each.socket.is_open()) continue;
      if (looked[i + 2].revents != 0) each.answer.empty() ? read_from(each) : write_to(each);
      if (now >= each.until) each.socket.close();
    }
    if ((looked[1].revents & POLLIN) != 0) accept_one(now);
  }
}

void ScrapeServer::accept_one(Clock::time_point now) {
  ipc::Descriptor socket(accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
  if (!socket.is_open()) return;
  const auto by_room = [](const Connection& one, const Connection& other) {
    const auto rank = [](const Connection& each) { return std::pair(each.socket.is_open(), !each.answer.empty()); };
    return std::pair(rank(one), one.until) < std::pair(rank(other), other.until);
  };
  Connection& room = *std::ranges::min_element(connections_, by_room);
  room = {std::move(socket), now + kRequestTime, {}, {}, 0};
}

void ScrapeServer::read_from(Connection& connection) {
  std::array<char, 2048> piece;  // uninitialised: what recv() filled is read
  const ssize_t got = recv(connection.socket.get(), piece.data(), piece.size(), 0);
  if (got <= 0) {
    if (got == 0 || (errno != EAGAIN && errno != EINTR)) connection.socket.close();
    return;
  }
  connection.request.append(piece.data(), static_cast<std::size_t>(got));
  if (is_complete(connection.request))
    connection.answer = answer_to(connection.request);
  else if (connection.request.size() >= kMostRequestBytes)
    connection.answer = refusal("431 Request Header Fields Too Large");
}

void ScrapeServer::write_to(Connection& connection) const {
  const std::string_view left = std::string_view(connection.answer).substr(connection.sent);
  const ssize_t wrote = send(connection.socket.get(), left.data(), left.size(), MSG_NOSIGNAL);
  if (wrote < 0) {
    if (errno != EAGAIN && errno != EINTR) connection.socket.close();
    return;
  }
  connection.sent += static_cast<std::size_t>(wrote);
  if (connection.sent < connection.answer.size()) return;
  shutdown(connection.socket.get(), SHUT_WR);  // what is not read yet would turn close() into a reset
  connection.socket.close();
}

std::string ScrapeServer::answer_to(std::string_view request) const {
  const std::string_view line = request.substr(0, request.find_first_of("\r\n"));
  const std::size_t method = line.find(' '), target = line.rfind(' ');
  if (method == std::string_view::npos || target == method || !line.substr(target + 1).starts_with("HTTP/1."))
    return refusal("400 Bad Request");
  if (line.substr(0, method) != "GET") return refusal("405 Method Not Allowed");
  const std::string_view asked = line.substr(method + 1, target - method - 1);
  if (asked.substr(0, asked.find('?')) != path_) return refusal("404 Not Found");
  return closing("200 OK", content_type_, page_());
}

}  // namespace takt::monitor
