// SPDX-License-Identifier: Apache-2.0
// Posts OTLP/HTTP requests in JSON to one receiver, in order, from a thread of its own.
//
// A receiver that is away or overloaded (no connection, 429, 502, 503, 504) is tried again with exponential backoff and
// jitter, or when its Retry-After says; any other refusal loses the request. What waits is bounded: the oldest gives
// way and is counted. An answer may have 64 KiB and take 5 s; no redirect is followed. Thread rule: construct, post()
// and destroy on one thread.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>

namespace takt::monitor {

enum class OtlpSignal : std::uint8_t { traces, metrics, logs };

struct OtlpDeliveries {
  std::uint64_t delivered = 0, refused = 0, overflowed = 0;  // requests
};

class OtlpSender {
 public:
  struct Patience {
    std::chrono::milliseconds first{1000}, longest{30'000};  // between two tries of one request
    std::size_t most_waiting_bytes = std::size_t{8} << 20U;
  };
  // `endpoint`: scheme://host[:port][/path]; /v1/traces, /v1/metrics and /v1/logs are put behind it.
  explicit OtlpSender(const std::string& endpoint);
  OtlpSender(const std::string& endpoint, Patience patience);
  // False where the build has no HTTP (TAKT_WITH_OTLP): none may be constructed then.
  static bool is_built_in();
  // After the request under way, tries each that waits once more, for two seconds at most.
  ~OtlpSender();
  OtlpSender(const OtlpSender&) = delete;
  OtlpSender& operator=(const OtlpSender&) = delete;

  void post(OtlpSignal signal, std::string body);
  [[nodiscard]] OtlpDeliveries deliveries() const;

 private:
  struct Request {
    OtlpSignal signal;
    std::string body;
  };
  enum class Outcome : std::uint8_t { delivered, refused, later };
  struct Answer {
    Outcome outcome = Outcome::later;
    std::string why{};
    std::chrono::milliseconds wait{0};  // Retry-After; 0: not said
  };

  void send_until_closed();
  void send_rest();
  [[nodiscard]] Answer try_once(const Request& request, std::chrono::milliseconds limit) const;
  void settle(const Answer& answer);
  void wait(std::chrono::milliseconds limit);

  std::string endpoint_;
  Patience patience_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Request> waiting_;  // guarded, as all below
  std::size_t waiting_bytes_ = 0;
  std::uint64_t first_number_ = 0;  // of the request in front; grows when it leaves
  OtlpDeliveries deliveries_;
  bool closed_ = false;
  std::string said_;    // sending thread
  std::thread thread_;  // last: everything else is there when it starts
};

}  // namespace takt::monitor
