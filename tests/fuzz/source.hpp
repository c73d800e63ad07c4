// SPDX-License-Identifier: Apache-2.0
// The fuzzer's input, taken piece by piece.
#pragma once

#include <signal.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <source_location>
#include <span>
#include <string>
#include <type_traits>

namespace takt::fuzz {

inline void require(bool holds, const std::source_location& where = std::source_location::current()) {
  if (holds) return;
  std::fprintf(stderr, "%s:%u does not hold\n", where.file_name(), static_cast<unsigned>(where.line()));
  std::abort();
}

// libFuzzer looks at the time in a handler of SIGALRM: a connect() or recv() that it meets begins again.
inline void restart_interrupted_calls() {
  struct sigaction alarm {};
  require(::sigaction(SIGALRM, nullptr, &alarm) == 0);
  if ((alarm.sa_flags & SA_RESTART) != 0) return;
  alarm.sa_flags |= SA_RESTART;
  require(::sigaction(SIGALRM, &alarm, nullptr) == 0);
}

// Zeros after the input's end.
class Source {
 public:
  explicit Source(std::span<const std::uint8_t> bytes) : left_(bytes) {
    [[maybe_unused]] static const bool is_once = (restart_interrupted_calls(), true);
  }
  [[nodiscard]] bool is_empty() const { return left_.empty(); }
  std::uint8_t byte() {
    if (left_.empty()) return 0;
    const std::uint8_t value = left_.front();
    left_ = left_.subspan(1);
    return value;
  }
  void copy_to(void* out, std::size_t size) {
    const std::size_t given = std::min(size, left_.size());
    std::memset(out, 0, size);
    if (given != 0) std::memcpy(out, left_.data(), given);
    left_ = left_.subspan(given);
  }
  template <class Value>
  Value value() {
    static_assert(std::is_trivially_copyable_v<Value>);
    Value value{};
    copy_to(&value, sizeof value);
    return value;
  }
  // Shorter at the input's end.
  std::string text(std::size_t size) {
    const auto piece = left_.first(std::min(size, left_.size()));
    left_ = left_.subspan(piece.size());
    return {piece.begin(), piece.end()};
  }
  std::string text() { return text(byte()); }
  // Writes bytes of the input over a message that is sound otherwise: so many times a place and 1 to 8 bytes.
  template <class Message>
  void spoil(Message& message) {
    static_assert(std::is_trivially_copyable_v<Message>);
    auto* const bytes = reinterpret_cast<std::byte*>(&message);
    for (int times = byte() % 8; times > 0; --times) {
      const std::size_t at = (byte() + 256U * byte()) % sizeof message;
      copy_to(bytes + at, std::min<std::size_t>(1U + byte() % 8U, sizeof message - at));
    }
  }

 private:
  std::span<const std::uint8_t> left_;
};

}  // namespace takt::fuzz
