// SPDX-License-Identifier: Apache-2.0
// Lines on their way to a file descriptor that may have no reader: a bounded queue, and a thread of its own that
// writes. push() never waits for the reader: when the queue is full, the oldest line makes room and is counted, and the
// next line that gets through is preceded by the number. A descriptor that is closed or broken swallows lines, counted.
//
// At the end what is queued gets a short while to be read; a writer that is stuck then is left behind, and dies with
// the process. Precondition for the process: SIGPIPE is ignored. Thread rules: any thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace takt::log {

class LineQueue {
 public:
  // `fd` stays open for as long as the process lives. capacity: lines, >= 1. Throws std::system_error: no thread.
  LineQueue(int fd, std::size_t capacity);
  LineQueue(const LineQueue&) = delete;
  LineQueue& operator=(const LineQueue&) = delete;
  ~LineQueue();  // drains for kLastWords at most

  // `line` ends with a newline.
  void push(std::string line);
  // True once everything pushed before was written or counted as lost; false after `patience`.
  bool drain(std::chrono::milliseconds patience);
  // Lines that were dropped, since the start.
  [[nodiscard]] std::uint64_t dropped() const;

 private:
  struct Shared;
  static void* write_for(void* share);
  std::shared_ptr<Shared> shared_;  // with the writer, which may outlive us
};

inline constexpr std::chrono::milliseconds kLastWords{300};

}  // namespace takt::log
