// SPDX-License-Identifier: Apache-2.0
#include "cli/top/rate_meter.hpp"

#include <algorithm>

namespace takt::monitor::top {
namespace {

constexpr Duration kBin = milliseconds(100);

}  // namespace

void RateMeter::add(MonoTime at, double amount) {
  const std::int64_t bin = at.ns / kBin.ns;
  if (bin < 0 || bin <= newest_ - kBins) return;
  for (std::int64_t cleared = std::max(newest_ + 1, bin - kBins + 1); cleared <= bin; ++cleared)
    bins_[static_cast<std::size_t>(cleared % kBins)] = 0;
  newest_ = std::max(newest_, bin);
  bins_[static_cast<std::size_t>(bin % kBins)] += amount;
}

double RateMeter::per_second(MonoTime now) const {
  const std::int64_t current = now.ns / kBin.ns;
  double sum = 0;
  for (std::int64_t bin = std::max<std::int64_t>(current - kBins + 1, 0); bin < current; ++bin)
    if (bin > newest_ - kBins && bin <= newest_) sum += bins_[static_cast<std::size_t>(bin % kBins)];
  return sum;
}

}  // namespace takt::monitor::top
