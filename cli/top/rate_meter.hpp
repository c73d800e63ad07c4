// SPDX-License-Identifier: Apache-2.0
// How much came per second, over the last whole second in bins of 100 ms. Fixed memory; times in any order as long as
// they are at most a second old. Pure. Thread rule: one thread at a time.
#pragma once

#include <array>
#include <cstdint>

#include "executive/contract/mono_time.hpp"

namespace takt::monitor::top {

class RateMeter {
 public:
  void add(MonoTime at, double amount);
  // Over the ten whole bins before `now`; 0 where nothing came.
  [[nodiscard]] double per_second(MonoTime now) const;

 private:
  static constexpr std::int64_t kBins = 11;  // ten whole ones and the one being filled
  std::array<double, kBins> bins_{};
  std::int64_t newest_ = 0;
};

}  // namespace takt::monitor::top
