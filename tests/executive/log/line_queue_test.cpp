// SPDX-License-Identifier: Apache-2.0
// Goal: a caller that logs is never held up by the reader, nothing is lost in silence, and a program can end. Method:
// pipes that are not read, that are read late, or that are closed. A push that blocked would hang its test.
#include "executive/log/line_queue.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <sstream>
#include <utility>

namespace takt::log {
namespace {

using namespace std::chrono_literals;

class LineQueueTest : public testing::Test {
 protected:
  LineQueueTest() {
    std::signal(SIGPIPE, SIG_IGN);
    EXPECT_EQ(pipe2(ends_, O_CLOEXEC), 0);
  }
  // The write end stays open: a writer that is left behind may still hold it.
  ~LineQueueTest() override { stop_reading(); }
  void stop_reading() {
    if (ends_[0] >= 0) close(std::exchange(ends_[0], -1));
  }
  [[nodiscard]] int write_end() const { return ends_[1]; }
  // Not one more byte fits, whenever the queue's own thread gets a processor.
  void fill_with(char filler) {
    const int flags = fcntl(ends_[1], F_GETFL);
    fcntl(ends_[1], F_SETFL, flags | O_NONBLOCK);
    while (write(ends_[1], &filler, 1) == 1) {
    }
    fcntl(ends_[1], F_SETFL, flags);
  }
  // Everything until `end` has been read.
  std::string read_until(const std::string& end) {
    std::string text;
    while (text.find(end) == std::string::npos) {
      char some[4096];
      const ssize_t size = read(ends_[0], some, sizeof some);
      if (size <= 0) break;
      text.append(some, static_cast<std::size_t>(size));
    }
    return text;
  }

  int ends_[2] = {-1, -1};
};

TEST_F(LineQueueTest, LinesArriveInTheirOrder) {
  LineQueue queue(write_end(), 100);
  for (int i = 0; i < 50; ++i) queue.push("line " + std::to_string(i) + "\n");
  EXPECT_TRUE(queue.drain(10s));
  const std::string text = read_until("line 49\n");
  EXPECT_EQ(text.find("line 0\nline 1\nline 2\n"), 0U);
  EXPECT_EQ(std::ranges::count(text, '\n'), 50);
  EXPECT_EQ(queue.dropped(), 0U);
}

// 100,000 lines of 100 bytes into a pipe that is full and not read: none waits. Then they are read: the newest
// lines are there, and how many are not.
TEST_F(LineQueueTest, AFullPipeHoldsNobodyUpAndTheLossIsSaid) {
  constexpr int kPushed = 100'000;
  constexpr std::size_t kCapacity = 200;
  const std::string padding(90, '.');
  fill_with('#');
  LineQueue queue(write_end(), kCapacity);
  for (int i = 0; i < kPushed; ++i) queue.push(padding + std::to_string(i) + "\n");
  EXPECT_FALSE(queue.drain(1ms));
  EXPECT_GT(queue.dropped(), static_cast<std::uint64_t>(kPushed) / 2);
  std::string text = read_until(std::to_string(kPushed - 1) + "\n");
  text.erase(0, text.find_first_not_of('#'));
  std::uint64_t lines = 0, confessed = 0;
  std::istringstream all(text);
  for (std::string line; std::getline(all, line);) {
    const bool confession = line.find(" log lines dropped: ") != std::string::npos;
    if (confession) confessed += std::stoull(line);
    lines += confession ? 0 : 1;
  }
  EXPECT_EQ(lines + confessed, static_cast<std::uint64_t>(kPushed)) << "every line was read, or said to be lost";
  EXPECT_EQ(confessed, queue.dropped());
}

TEST_F(LineQueueTest, AReaderWhoLeftEndsNobody) {
  LineQueue queue(write_end(), 10);
  stop_reading();
  for (int i = 0; i < 100; ++i) queue.push("to nobody\n");
  EXPECT_TRUE(queue.drain(10s)) << "the lines are gone, and counted";
  EXPECT_EQ(queue.dropped(), 100U);
}

// The writer is stuck in its write: the end does not wait for it for ever. (The pipe is not read until then.)
TEST_F(LineQueueTest, AStuckWriterIsLeftBehind) {
  {
    LineQueue queue(write_end(), 2000);
    for (int i = 0; i < 2000; ++i) queue.push(std::string(100, 'x') + "\n");
  }
  pollfd readable{ends_[0], POLLIN, 0};
  EXPECT_EQ(poll(&readable, 1, 0), 1) << "what fitted is there";
}

}  // namespace
}  // namespace takt::log
