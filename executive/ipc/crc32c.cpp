// SPDX-License-Identifier: Apache-2.0
#include "executive/ipc/crc32c.hpp"

#include <array>
#include <atomic>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace takt::ipc {
namespace {

constexpr std::uint32_t kPolynomial = 0x82F6'3B78;  // reflected

// value * x mod P, in the reflected representation (bit 31 is x^0).
constexpr std::uint32_t times_x(std::uint32_t value) {
  return (value >> 1U) ^ ((value & 1U) != 0 ? kPolynomial : 0U);
}

constexpr std::array<std::uint32_t, 256> make_byte_table() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t value = byte;
    for (int bit = 0; bit < 8; ++bit) value = times_x(value);
    table[byte] = value;
  }
  return table;
}
constexpr std::array<std::uint32_t, 256> kByteTable = make_byte_table();

using Function = std::uint32_t (*)(std::span<const std::byte>, std::uint32_t) noexcept;

#if defined(__x86_64__)

// One crc32 instruction takes three cycles but a new one can start every cycle: three lanes run side by side and are
// joined by a carry-less multiplication. Appending n words multiplies a checksum by x^(64 n); the crc32 of a 63-bit
// product multiplies by x^33, hence the entry for n words is x^(64 n - 33).
constexpr std::size_t kMaxLaneWords = 128;

constexpr std::array<std::uint32_t, 2 * kMaxLaneWords + 1> make_shift_table() {
  std::array<std::uint32_t, 2 * kMaxLaneWords + 1> table{};
  std::uint32_t power = 0x8000'0000;  // x^0
  for (int i = 0; i < 31; ++i) power = times_x(power);
  for (std::size_t words = 1; words < table.size(); ++words) {
    table[words] = power;
    for (int i = 0; i < 64; ++i) power = times_x(power);
  }
  return table;
}
constexpr std::array<std::uint32_t, 2 * kMaxLaneWords + 1> kShiftByWords = make_shift_table();

std::uint64_t load_word(const std::byte* from) {
  std::uint64_t word = 0;
  std::memcpy(&word, from, sizeof word);
  return word;
}

__attribute__((target("sse4.2,pclmul"))) std::uint64_t product(std::uint64_t crc, std::size_t words) {
  const __m128i a = _mm_cvtsi64_si128(static_cast<std::int64_t>(crc));
  const __m128i b = _mm_cvtsi64_si128(static_cast<std::int64_t>(kShiftByWords[words]));
  return static_cast<std::uint64_t>(_mm_cvtsi128_si64(_mm_clmulepi64_si128(a, b, 0)));
}

__attribute__((target("sse4.2,pclmul"))) std::uint32_t crc32c_by_instruction(std::span<const std::byte> data,
                                                                             std::uint32_t previous) noexcept {
  const std::byte* at = data.data();
  std::size_t words = data.size() / 8;
  std::uint64_t crc = ~previous;
  while (words >= 12) {
    const std::size_t lane = words / 3 < kMaxLaneWords ? words / 3 : kMaxLaneWords;
    std::uint64_t second = 0;
    std::uint64_t third = 0;
    for (std::size_t i = 0; i < lane; ++i) {
      crc = _mm_crc32_u64(crc, load_word(at + 8 * i));
      second = _mm_crc32_u64(second, load_word(at + 8 * (lane + i)));
      third = _mm_crc32_u64(third, load_word(at + 8 * (2 * lane + i)));
    }
    crc = third ^ _mm_crc32_u64(0, product(crc, 2 * lane) ^ product(second, lane));
    at += 24 * lane;
    words -= 3 * lane;
  }
  for (; words != 0; --words, at += 8) crc = _mm_crc32_u64(crc, load_word(at));
  auto short_crc = static_cast<std::uint32_t>(crc);
  for (std::size_t left = data.size() % 8; left != 0; --left, ++at) {
    short_crc = _mm_crc32_u8(short_crc, std::to_integer<std::uint8_t>(*at));
  }
  return ~short_crc;
}

Function best() {
  __builtin_cpu_init();
  return __builtin_cpu_supports("sse4.2") && __builtin_cpu_supports("pclmul") ? crc32c_by_instruction : crc32c_by_table;
}

#else

Function best() {
  return crc32c_by_table;
}

#endif

std::uint32_t choose(std::span<const std::byte> data, std::uint32_t previous) noexcept;
constinit std::atomic<Function> chosen{choose};

std::uint32_t choose(std::span<const std::byte> data, std::uint32_t previous) noexcept {
  const Function function = best();
  chosen.store(function, std::memory_order_relaxed);
  return function(data, previous);
}

}  // namespace

std::uint32_t crc32c_by_table(std::span<const std::byte> data, std::uint32_t previous) noexcept {
  std::uint32_t crc = ~previous;
  for (const std::byte byte : data) {
    crc = kByteTable[(crc ^ std::to_integer<std::uint32_t>(byte)) & 0xFFU] ^ (crc >> 8U);
  }
  return ~crc;
}

std::uint32_t crc32c(std::span<const std::byte> data, std::uint32_t previous) noexcept {
  return chosen.load(std::memory_order_relaxed)(data, previous);
}

}  // namespace takt::ipc
