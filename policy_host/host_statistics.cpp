// SPDX-License-Identifier: Apache-2.0
#include "policy_host/host_statistics.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace takt::policy_host {

void HostStatistics::add(const CommandHeader& published) {
  infer_ns_.push_back((published.infer_ended_at - published.infer_started_at).ns);
  dropped_ += published.dropped_observations;
}

std::string HostStatistics::summary(Duration window) {
  std::ranges::sort(infer_ns_);
  // Nearest rank, in milliseconds.
  const auto quantile = [this](std::size_t percent) {
    if (infer_ns_.empty()) return 0.0;
    return nanoseconds(infer_ns_[(infer_ns_.size() * percent + 99) / 100 - 1]).milliseconds();
  };
  auto line = fmt::format(
      "{:.1f} commands/s, inference p50 {:.3f} ms p99 {:.3f} ms, {} observations dropped, {} withheld, {} "
      "answers overtaken",
      static_cast<double>(infer_ns_.size()) / window.seconds(), quantile(50), quantile(99), dropped_, withheld_,
      overtaken_);
  infer_ns_.clear();
  dropped_ = withheld_ = overtaken_ = 0;
  return line;
}

}  // namespace takt::policy_host
