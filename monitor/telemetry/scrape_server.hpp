// SPDX-License-Identifier: Apache-2.0
// The least HTTP that a scraper needs, bounded in every direction (prometheus_server.hpp has the bounds): one GET per
// connection, answered and closed. Thread rule: one thread.
#pragma once

#include <array>
#include <chrono>
#include <expected>
#include <functional>
#include <string>
#include <string_view>

#include "executive/ipc/descriptor.hpp"

namespace takt::monitor {

inline constexpr std::size_t kMostConnections = 16;
inline constexpr std::size_t kMostRequestBytes = 8192;
inline constexpr std::chrono::seconds kRequestTime{5};

class ScrapeServer {
 public:
  // `page`: what GET `path` answers, made anew for each request. Error: why the address cannot be had.
  static std::expected<ScrapeServer, std::string> listen(const std::string& address, std::uint16_t port,
                                                         std::string path, std::string_view content_type,
                                                         std::function<std::string()> page);
  // Serves until `stop` is readable.
  void serve(const ipc::Descriptor& stop);

 private:
  using Clock = std::chrono::steady_clock;
  struct Connection {
    ipc::Descriptor socket;
    Clock::time_point until;
    std::string request;
    std::string answer;  // empty: the request is not complete
    std::size_t sent = 0;
  };

  ScrapeServer(ipc::Descriptor listener, std::string path, std::string_view content_type,
               std::function<std::string()> page)
      : listener_(std::move(listener)), path_(std::move(path)), content_type_(content_type), page_(std::move(page)) {}
  void accept_one(Clock::time_point now);
  void read_from(Connection& connection);
  void write_to(Connection& connection) const;
  [[nodiscard]] std::string answer_to(std::string_view request) const;

  ipc::Descriptor listener_;
  std::string path_, content_type_;
  std::function<std::string()> page_;
  std::array<Connection, kMostConnections> connections_;
};

}  // namespace takt::monitor
