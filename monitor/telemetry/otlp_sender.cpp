// SPDX-License-Identifier: Apache-2.0
#include "monitor/telemetry/otlp_sender.hpp"

#include <fmt/format.h>
#include <httplib.h>
#include <signal.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>
#include <random>

namespace takt::monitor {
namespace {

using std::chrono::milliseconds;

constexpr auto kRequestTimeout = std::chrono::seconds(10);
constexpr auto kLastWords = milliseconds(2000);

std::string_view path_of(OtlpSignal signal) {
  switch (signal) {
    case OtlpSignal::traces:
      return "/v1/traces";
    case OtlpSignal::metrics:
      return "/v1/metrics";
    case OtlpSignal::logs:
      return "/v1/logs";
  }
  return "";
}

bool is_temporary(int status) {
  return status == 429 || status == 502 || status == 503 || status == 504;
}

// Seconds; the header's other form, a date, is not said by receivers of telemetry.
milliseconds retry_after(const httplib::Response& response) {
  const std::string text = response.get_header_value("Retry-After");
  unsigned seconds = 0;
  std::from_chars(text.data(), text.data() + text.size(), seconds);
  return milliseconds(std::int64_t{1000} * std::min(seconds, 600U));
}

// httplib's client looks whether the receiver is there, then writes without MSG_NOSIGNAL: one that hangs up in between
// would end the monitor. A blocked SIGPIPE is dropped with the thread it was meant for; the write says EPIPE. Calling
// thread only.
void survive_hang_ups() {
  sigset_t pipe;
  sigemptyset(&pipe);
  sigaddset(&pipe, SIGPIPE);
  pthread_sigmask(SIG_BLOCK, &pipe, nullptr);
}

// Where the path begins: behind the host.
std::size_t end_of_host(const std::string& endpoint) {
  const std::size_t scheme = endpoint.find("://");
  return std::min(endpoint.find('/', scheme == std::string::npos ? 0 : scheme + 3), endpoint.size());
}

}  // namespace

OtlpSender::OtlpSender(const std::string& endpoint) : OtlpSender(endpoint, Patience{}) {}

OtlpSender::OtlpSender(const std::string& endpoint, Patience patience)
    : host_(endpoint.substr(0, end_of_host(endpoint))),
      path_(endpoint.substr(end_of_host(endpoint))),
      patience_(patience) {
  while (path_.ends_with('/')) path_.pop_back();
  thread_ = std::thread([this] { send_until_closed(); });
}

OtlpSender::~OtlpSender() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  changed_.notify_all();
  thread_.join();
  if (deliveries_.refused + deliveries_.overflowed + waiting_.size() != 0)
    spdlog::warn("OTLP: {} requests delivered, {} refused, {} lost because the receiver was away",
                 deliveries_.delivered, deliveries_.refused, deliveries_.overflowed + waiting_.size());
}

void OtlpSender::post(OtlpSignal signal, std::string body) {
  {
    const std::lock_guard lock(mutex_);
    waiting_bytes_ += body.size();
    waiting_.push_back({signal, std::move(body)});
    while (waiting_bytes_ > patience_.most_waiting_bytes && !waiting_.empty()) {
      waiting_bytes_ -= waiting_.front().body.size();
      waiting_.pop_front();
      ++first_number_;
      ++deliveries_.overflowed;
    }
  }
  changed_.notify_all();
}

OtlpDeliveries OtlpSender::deliveries() const {
  const std::lock_guard lock(mutex_);
  return deliveries_;
}

void OtlpSender::wait(milliseconds limit) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, limit, [this] { return closed_; });
}

void OtlpSender::send_until_closed() {
  survive_hang_ups();
  std::minstd_rand random(std::random_device{}());
  milliseconds delay = patience_.first;
  while (true) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return closed_ || !waiting_.empty(); });
    if (closed_) break;
    const Request request = waiting_.front();
    const std::uint64_t number = first_number_;
    lock.unlock();
    const Answer answer = try_once(request, kRequestTimeout);
    if (answer.outcome != Outcome::later) {
      delay = patience_.first;
      lock.lock();
      if (first_number_ == number) settle(answer);
      continue;
    }
    if (said_ != answer.why) spdlog::warn("OTLP: {}: {}; trying again", host_, said_ = answer.why);
    const milliseconds jitter(std::uniform_int_distribution<std::int64_t>(0, delay.count() / 2)(random));
    wait(answer.wait.count() != 0 ? answer.wait : delay / 2 + jitter);
    delay = std::min(delay * 2, patience_.longest);
  }
  send_rest();
}

// The request in front leaves the queue. Precondition: the lock is held.
void OtlpSender::settle(const Answer& answer) {
  ++(answer.outcome == Outcome::delivered ? deliveries_.delivered : deliveries_.refused);
  if (answer.outcome == Outcome::refused && said_ != answer.why)
    spdlog::error("OTLP: {} refuses what it is sent: {}", host_, said_ = answer.why);
  waiting_bytes_ -= waiting_.front().body.size();
  waiting_.pop_front();
  ++first_number_;
}

void OtlpSender::send_rest() {
  const auto deadline = std::chrono::steady_clock::now() + kLastWords;
  const std::lock_guard lock(mutex_);
  while (!waiting_.empty()) {
    const auto left = std::chrono::duration_cast<milliseconds>(deadline - std::chrono::steady_clock::now());
    if (left.count() <= 0) return;
    const Answer answer = try_once(waiting_.front(), left);
    if (answer.outcome == Outcome::later) return;
    settle(answer);
  }
}

OtlpSender::Answer OtlpSender::try_once(const Request& request, milliseconds limit) const {
  httplib::Client client(host_);
  client.set_connection_timeout(limit);
  client.set_read_timeout(limit);
  client.set_write_timeout(limit);
  const std::string path = path_ + std::string(path_of(request.signal));
  const auto result = client.Post(path, request.body, "application/json");
  if (!result) return {Outcome::later, httplib::to_string(result.error())};
  if (result->status >= 200 && result->status < 300) return {Outcome::delivered};
  const std::string why = fmt::format("HTTP {} for {}", result->status, path);
  if (is_temporary(result->status)) return {Outcome::later, why, retry_after(*result)};
  return {Outcome::refused, why};
}

}  // namespace takt::monitor
