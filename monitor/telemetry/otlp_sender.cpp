// SPDX-License-Identifier: Apache-2.0
#include "monitor/telemetry/otlp_sender.hpp"

#include <curl/curl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <memory>
#include <random>

namespace takt::monitor {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kRequestTimeout{5000};  // from the first byte sent to the last one received
constexpr milliseconds kLastWords{2000};
constexpr std::size_t kMostAnswerBytes = std::size_t{64} << 10U;  // of head and body together

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

bool is_temporary(long status) {
  return status == 429 || status == 502 || status == 503 || status == 504;
}

// What a receiver answers.
struct Exchange {
  std::size_t bytes = 0;
  milliseconds retry_after{0};  // 0: not said
};

bool is_named(std::string_view line, std::string_view name) {
  return line.size() > name.size() && std::ranges::equal(line.substr(0, name.size()), name, [](char one, char other) {
           return std::tolower(static_cast<unsigned char>(one)) == other;
         });
}

std::size_t take_bytes(const char* /*data*/, std::size_t size, std::size_t count, void* exchange) {
  auto& all = static_cast<Exchange*>(exchange)->bytes;
  all += size * count;
  return all <= kMostAnswerBytes ? size * count : 0;  // 0: ends the transfer
}

// Retry-After in seconds; its other form, a date, is not said by receivers of telemetry.
std::size_t take_header(const char* data, std::size_t size, std::size_t count, void* exchange) {
  constexpr std::string_view kName = "retry-after:";
  const std::string_view line(data, size * count);
  if (is_named(line, kName)) {
    const std::string_view text = line.substr(std::min(line.find_first_not_of(' ', kName.size()), line.size()));
    unsigned seconds = 0;
    std::from_chars(text.data(), text.data() + text.size(), seconds);
    static_cast<Exchange*>(exchange)->retry_after = milliseconds(std::int64_t{1000} * std::min(seconds, 600U));
  }
  return take_bytes(data, size, count, exchange);
}

// A write through TLS knows no MSG_NOSIGNAL: a receiver that hangs up would end the monitor. A blocked SIGPIPE is
// dropped with the thread it was meant for; the write says EPIPE. Calling thread only.
void survive_hang_ups() {
  sigset_t pipe;
  sigemptyset(&pipe);
  sigaddset(&pipe, SIGPIPE);
  pthread_sigmask(SIG_BLOCK, &pipe, nullptr);
}

}  // namespace

bool OtlpSender::is_built_in() {
  return true;
}

OtlpSender::OtlpSender(const std::string& endpoint) : OtlpSender(endpoint, Patience{}) {}

OtlpSender::OtlpSender(const std::string& endpoint, Patience patience) : endpoint_(endpoint), patience_(patience) {
  while (endpoint_.ends_with('/')) endpoint_.pop_back();
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
    if (said_ != answer.why) spdlog::warn("OTLP: {}: {}; trying again", endpoint_, said_ = answer.why);
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
    spdlog::error("OTLP: {} refuses what it is sent: {}", endpoint_, said_ = answer.why);
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
  const std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> handle(curl_easy_init(), curl_easy_cleanup);
  curl_slist* said = curl_slist_append(nullptr, "Content-Type: application/json");
  said = curl_slist_append(said, "Expect:");
  const std::unique_ptr<curl_slist, decltype(&curl_slist_free_all)> headers(said, curl_slist_free_all);
  Exchange exchange;
  CURL* const transfer = handle.get();
  const std::string path(path_of(request.signal));
  curl_easy_setopt(transfer, CURLOPT_URL, (endpoint_ + path).c_str());
  curl_easy_setopt(transfer, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(transfer, CURLOPT_NOPROXY, "*");
  curl_easy_setopt(transfer, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(transfer, CURLOPT_TIMEOUT_MS, static_cast<long>(limit.count()));
  curl_easy_setopt(transfer, CURLOPT_HTTPHEADER, headers.get());
  curl_easy_setopt(transfer, CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(request.body.size()));
  curl_easy_setopt(transfer, CURLOPT_POSTFIELDS, request.body.data());
  curl_easy_setopt(transfer, CURLOPT_HEADERFUNCTION, take_header);
  curl_easy_setopt(transfer, CURLOPT_HEADERDATA, &exchange);
  curl_easy_setopt(transfer, CURLOPT_WRITEFUNCTION, take_bytes);
  curl_easy_setopt(transfer, CURLOPT_WRITEDATA, &exchange);
  const CURLcode result = curl_easy_perform(transfer);
  if (exchange.bytes > kMostAnswerBytes) return {Outcome::refused, "it answers with more than 64 KiB"};
  if (result != CURLE_OK) return {Outcome::later, curl_easy_strerror(result)};
  long status = 0;
  curl_easy_getinfo(transfer, CURLINFO_RESPONSE_CODE, &status);
  if (status >= 200 && status < 300) return {Outcome::delivered};
  const std::string why = fmt::format("HTTP {} for {}", status, path);
  if (is_temporary(status)) return {Outcome::later, why, exchange.retry_after};
  return {Outcome::refused, why};
}

}  // namespace takt::monitor
