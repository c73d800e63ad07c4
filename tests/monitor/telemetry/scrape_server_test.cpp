// SPDX-License-Identifier: Apache-2.0
// Goal: whatever its neighbours send, a scraper gets its page, and a request costs bounded memory. Method: a real
// server on loopback; requests without an end, slow ones, ones that are no GET, and a scraper beside them.
#include "monitor/telemetry/scrape_server.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <thread>
#include <vector>

namespace takt::monitor {
namespace {

std::uint16_t free_port() {
  const ipc::Descriptor probe(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof address;
  EXPECT_EQ(bind(probe.get(), reinterpret_cast<sockaddr*>(&address), length), 0);
  EXPECT_EQ(getsockname(probe.get(), reinterpret_cast<sockaddr*>(&address), &length), 0);
  return ntohs(address.sin_port);
}

class Scrapes : public testing::Test {
 protected:
  Scrapes() {
    auto server = ScrapeServer::listen("127.0.0.1", port_, "/metrics", "text/plain", [this] { return page_; });
    EXPECT_TRUE(server) << server.error();
    thread_ = std::thread([this, one = std::move(*server)]() mutable { one.serve(stop_); });
  }
  ~Scrapes() override {
    eventfd_write(stop_.get(), 1);
    thread_.join();
  }
  [[nodiscard]] ipc::Descriptor connected() const {
    ipc::Descriptor client(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port_);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(connect(client.get(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    return client;
  }
  // Bytes that left before the server hung up, at most `most`.
  static std::size_t poured_into(const ipc::Descriptor& client, const std::string& piece, std::size_t most) {
    std::size_t sent = 0;
    while (sent < most) {
      const ssize_t wrote = send(client.get(), piece.data(), piece.size(), MSG_NOSIGNAL);
      if (wrote <= 0) break;
      sent += static_cast<std::size_t>(wrote);
    }
    return sent;
  }
  static std::string answer_of(const ipc::Descriptor& client) {
    std::string answer;
    char piece[4096];
    for (ssize_t got = 0; (got = recv(client.get(), piece, sizeof piece, 0)) > 0;)
      answer.append(piece, static_cast<std::size_t>(got));
    return answer;
  }
  [[nodiscard]] std::string asked(const std::string& request) const {
    const ipc::Descriptor client = connected();
    EXPECT_EQ(send(client.get(), request.data(), request.size(), MSG_NOSIGNAL), static_cast<ssize_t>(request.size()));
    return answer_of(client);
  }
  [[nodiscard]] std::string scraped() const { return asked("GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n"); }

  std::string page_ = "takt_up 1\n";
  const std::uint16_t port_ = free_port();
  const ipc::Descriptor stop_{eventfd(0, EFD_CLOEXEC)};
  std::thread thread_;
};

TEST_F(Scrapes, AGetOfThePageIsAnswered) {
  for (const char* const target : {"/metrics", "/metrics?name=x"}) {
    const std::string answer = asked(std::string("GET ") + target + " HTTP/1.1\r\n\r\n");
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 OK\r\n") && answer.ends_with("\r\n\r\ntakt_up 1\n")) << answer;
    EXPECT_NE(answer.find("Content-Length: 10\r\n"), std::string::npos) << answer;
  }
}

TEST_F(Scrapes, APageLargerThanTheSocketsBuffersComesWhole) {
  page_.assign(std::size_t{20} << 20U, 'x');
  EXPECT_TRUE(scraped().ends_with(page_));
}

TEST_F(Scrapes, WhatIsNoGetOfThePageIsRefused) {
  EXPECT_TRUE(asked("POST /metrics HTTP/1.1\r\nContent-Length: 600000000\r\n\r\n").starts_with("HTTP/1.1 405"));
  EXPECT_TRUE(asked("GET /other HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 404"));
  EXPECT_TRUE(asked("nonsense\r\n\r\n").starts_with("HTTP/1.1 400"));
  EXPECT_TRUE(asked("GET  HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 4"));
}

// A body, a line and headers without end: the server hangs up after 8 KiB; what left more filled the sockets' buffers.
// Threat: metrics-request
TEST_F(Scrapes, ARequestWithoutEndIsCutOff) {
  constexpr std::size_t kFarTooMuch = std::size_t{4} << 20U;
  constexpr int kSmallBuffer = 1 << 16;
  for (const std::string& begin : {std::string("POST /metrics HTTP/1.1\r\nContent-Length: 600000000\r\n\r\n"),
                                   std::string("GET /"), std::string("GET /metrics HTTP/1.1\r\n")}) {
    const ipc::Descriptor client = connected();
    setsockopt(client.get(), SOL_SOCKET, SO_SNDBUF, &kSmallBuffer, sizeof kSmallBuffer);
    ASSERT_GT(send(client.get(), begin.data(), begin.size(), MSG_NOSIGNAL), 0);
    // So little that all of it would get through before the server's time limit.
    std::string piece;
    while (piece.size() < 100'000) piece += begin.ends_with("HTTP/1.1\r\n") ? "X-More: and more\r\n" : "xxxxxxxx";
    EXPECT_LT(poured_into(client, piece, kFarTooMuch), kFarTooMuch);
    EXPECT_TRUE(scraped().ends_with("takt_up 1\n"));
  }
}

// Threat: metrics-slow
TEST_F(Scrapes, SlowNeighboursDoNotShutAScraperOut) {
  std::vector<ipc::Descriptor> slow;
  for (std::size_t i = 0; i < 3 * kMostConnections; ++i) {
    slow.push_back(connected());
    ASSERT_EQ(send(slow.back().get(), "GET /", 5, MSG_NOSIGNAL), 5);
    if (i % 8 == 0) {
      EXPECT_TRUE(scraped().ends_with("takt_up 1\n")) << i;
    }
  }
  EXPECT_TRUE(scraped().ends_with("takt_up 1\n"));
}

TEST_F(Scrapes, TwoServersDoNotShareAPort) {
  const auto second = ScrapeServer::listen("127.0.0.1", port_, "/metrics", "text/plain", [] { return ""; });
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error(), "Address already in use");
}

}  // namespace
}  // namespace takt::monitor
