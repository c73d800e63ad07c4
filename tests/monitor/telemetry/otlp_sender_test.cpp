// SPDX-License-Identifier: Apache-2.0
// Goal: a receiver gets every request once and in order, also when it is overloaded at first; what it refuses is not
// tried again; and one that is away costs bounded memory. Method: a real HTTP server on loopback that answers as told;
// waits are for what it counted.
#include "monitor/telemetry/otlp_sender.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <httplib.h>
#include <sys/socket.h>
#include <unistd.h>

#include <functional>
#include <vector>

namespace takt::monitor {
namespace {

constexpr OtlpSender::Patience kImpatient{.first = std::chrono::milliseconds(1),
                                          .longest = std::chrono::milliseconds(4)};

class Receiver {
 public:
  // `status_of` says what the nth request gets.
  explicit Receiver(std::function<int(std::size_t)> status_of) {
    server_.Post(R"(/.*)", [this, status_of](const httplib::Request& request, httplib::Response& response) {
      const std::lock_guard lock(mutex_);
      response.status = status_of(got_.size());
      got_.push_back(request.path + " " + request.get_header_value("Content-Type") + " " + request.body);
    });
    port_ = server_.bind_to_any_port("127.0.0.1");
    thread_ = std::thread([this] { server_.listen_after_bind(); });
    while (!server_.is_running()) std::this_thread::yield();
  }
  ~Receiver() {
    server_.stop();
    thread_.join();
  }
  [[nodiscard]] std::string endpoint() const { return "http://127.0.0.1:" + std::to_string(port_); }
  std::vector<std::string> wait_for(std::size_t requests) {
    for (int poll = 0; poll < 2000; ++poll) {
      {
        const std::lock_guard lock(mutex_);
        if (got_.size() >= requests) return got_;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    ADD_FAILURE() << "only " << got_.size() << " requests came";
    return got_;
  }

 private:
  httplib::Server server_;
  std::mutex mutex_;
  std::vector<std::string> got_;
  int port_ = 0;
  std::thread thread_;
};

TEST(OtlpSender, PostsEachSignalToItsPath) {
  Receiver receiver([](std::size_t) { return 200; });
  OtlpSender sender(receiver.endpoint() + "/otlp/", kImpatient);
  sender.post(OtlpSignal::traces, "{}");
  sender.post(OtlpSignal::metrics, "[]");
  EXPECT_EQ(receiver.wait_for(2),
            (std::vector<std::string>{"/otlp/v1/traces application/json {}", "/otlp/v1/metrics application/json []"}));
}

TEST(OtlpSender, TriesAgainWhenTheReceiverIsOverloaded) {
  Receiver receiver([](std::size_t nth) { return nth == 0 ? 503 : nth == 1 ? 429 : 200; });
  OtlpSender sender(receiver.endpoint(), kImpatient);
  sender.post(OtlpSignal::traces, "a");
  sender.post(OtlpSignal::traces, "b");
  const auto got = receiver.wait_for(4);
  ASSERT_EQ(got.size(), 4U);
  EXPECT_TRUE(got[0].ends_with(" a") && got[1].ends_with(" a") && got[2].ends_with(" a"));
  EXPECT_TRUE(got[3].ends_with(" b"));
}

TEST(OtlpSender, DoesNotRepeatWhatIsRefused) {
  Receiver receiver([](std::size_t nth) { return nth == 0 ? 400 : 200; });
  OtlpSender sender(receiver.endpoint(), kImpatient);
  sender.post(OtlpSignal::traces, "a");
  sender.post(OtlpSignal::traces, "b");
  const auto got = receiver.wait_for(2);
  EXPECT_TRUE(got[1].ends_with(" b"));
  while (sender.deliveries().delivered == 0) std::this_thread::yield();
  EXPECT_EQ(sender.deliveries().refused, 1U);
}

TEST(OtlpSender, AReceiverThatIsAwayCostsBoundedMemoryAndNoWaiting) {
  OtlpSender::Patience patience = kImpatient;
  patience.most_waiting_bytes = 1000;
  OtlpSender sender("http://127.0.0.1:1", patience);  // port 1: no process listens
  for (int i = 0; i < 100; ++i) sender.post(OtlpSignal::traces, std::string(100, 'x'));
  EXPECT_EQ(sender.deliveries().overflowed, 90U);
}

// It leaves with the sender's bytes unread, while the sender is still writing: the body is larger than the sockets'
// buffers.
TEST(OtlpSender, TriesAgainWhenTheReceiverHangsUp) {
  const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof address;
  ASSERT_EQ(bind(listener, reinterpret_cast<sockaddr*>(&address), length), 0);
  ASSERT_EQ(listen(listener, 8), 0);
  ASSERT_EQ(getsockname(listener, reinterpret_cast<sockaddr*>(&address), &length), 0);
  OtlpSender sender("http://127.0.0.1:" + std::to_string(ntohs(address.sin_port)), kImpatient);
  sender.post(OtlpSignal::traces, std::string(std::size_t{4} << 20U, 'x'));
  for (int connection = 0; connection < 5; ++connection) {
    const int accepted = accept(listener, nullptr, nullptr);
    char byte = 0;
    EXPECT_EQ(recv(accepted, &byte, 1, MSG_PEEK), 1);
    close(accepted);
  }
  close(listener);
  EXPECT_EQ(sender.deliveries().delivered + sender.deliveries().refused, 0U);
}

// Goal: a receiver cannot fill the monitor's memory. Method: it answers with a body, and with headers, without end,
// until the sender hangs up; what it took is bounded by the sockets' buffers, and the request counts as refused.
// Threat: otlp-answer
TEST(OtlpSender, HangsUpOnAnAnswerWithoutEnd) {
  for (const std::string endless : {"HTTP/1.1 200 OK\r\nContent-Length: 1000000000\r\n\r\n", "HTTP/1.1 200 OK\r\n"}) {
    const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    ASSERT_EQ(bind(listener, reinterpret_cast<sockaddr*>(&address), length), 0);
    ASSERT_EQ(listen(listener, 8), 0);
    ASSERT_EQ(getsockname(listener, reinterpret_cast<sockaddr*>(&address), &length), 0);
    OtlpSender sender("http://127.0.0.1:" + std::to_string(ntohs(address.sin_port)), kImpatient);
    sender.post(OtlpSignal::traces, "{}");
    const int accepted = accept(listener, nullptr, nullptr);
    std::string line;
    while (line.size() < 2000) line += "X-More: and more\r\n";
    std::size_t sent = 0;
    constexpr std::size_t kFarTooMuch = std::size_t{100} << 20U;
    bool is_there = send(accepted, endless.data(), endless.size(), MSG_NOSIGNAL) > 0;
    while (is_there && sent < kFarTooMuch) {
      const ssize_t wrote = send(accepted, line.data(), line.size(), MSG_NOSIGNAL);
      is_there = wrote > 0;
      sent += is_there ? static_cast<std::size_t>(wrote) : 0;
    }
    EXPECT_LT(sent, kFarTooMuch);
    while (sender.deliveries().refused == 0) std::this_thread::yield();
    close(accepted);
    close(listener);
  }
}

TEST(OtlpSender, LastWordsAreSentBeforeItEnds) {
  Receiver receiver([](std::size_t) { return 200; });
  {
    OtlpSender sender(receiver.endpoint(), kImpatient);
    for (int i = 0; i < 20; ++i) sender.post(OtlpSignal::metrics, std::to_string(i));
  }
  EXPECT_EQ(receiver.wait_for(20).size(), 20U);
}

}  // namespace
}  // namespace takt::monitor
