// SPDX-License-Identifier: Apache-2.0
// The MTi's own side of its protocol, written from the protocol's description and not from our decoder.
#pragma once

#include <bit>
#include <cstdint>
#include <numeric>
#include <vector>

namespace takt::test {

using Bytes = std::vector<std::uint8_t>;

struct MtiSays {
  std::uint16_t counter = 0;
  std::uint32_t ticks = 0;
  float q[4] = {1, 0, 0, 0};
  float rate[3] = {};
  float acceleration[3] = {0, 0, 9.81F};
};

inline void add_big(Bytes& to, std::uint64_t value, int bytes) {
  for (int i = bytes - 1; i >= 0; --i) to.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

template <class Real>
void add_item(Bytes& to, unsigned id, const float* values, int count) {
  add_big(to, id, 2);
  to.push_back(static_cast<std::uint8_t>(count * static_cast<int>(sizeof(Real))));
  for (int i = 0; i < count; ++i) {
    if constexpr (sizeof(Real) == 4)
      add_big(to, std::bit_cast<std::uint32_t>(values[i]), 4);
    else
      add_big(to, std::bit_cast<std::uint64_t>(static_cast<double>(values[i])), 8);
  }
}

inline Bytes message(std::uint8_t id, const Bytes& data, bool has_long_length = false) {
  Bytes all{0xFF, id};
  if (data.size() < 255 && !has_long_length)
    all.push_back(static_cast<std::uint8_t>(data.size()));
  else {
    all.push_back(255);
    add_big(all, data.size(), 2);
  }
  all.insert(all.end(), data.begin(), data.end());
  all.push_back(static_cast<std::uint8_t>(256U - std::accumulate(all.begin(), all.end(), 0U) % 256U));
  all.insert(all.begin(), 0xFA);
  return all;
}

// float32, ENU; with a status word, which was not requested.
inline Bytes mtdata2(const MtiSays& says) {
  Bytes data;
  add_big(data, 0x102002, 3);
  add_big(data, says.counter, 2);
  add_big(data, 0x106004, 3);
  add_big(data, says.ticks, 4);
  add_item<float>(data, 0x2010, says.q, 4);
  add_item<float>(data, 0x4020, says.acceleration, 3);
  add_item<float>(data, 0x8020, says.rate, 3);
  add_big(data, 0xE02004, 3);
  add_big(data, 0x3, 4);
  return data;
}

}  // namespace takt::test
