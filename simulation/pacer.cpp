// SPDX-License-Identifier: Apache-2.0
#include "simulation/pacer.hpp"

#include <algorithm>

namespace takt::simulation {

int Pacer::steps_due(MonoTime now) {
  if (now < next_) return 0;
  const std::int64_t due = (now - next_).ns / step_.ns + 1;
  next_ = next_ + step_ * due;
  const std::int64_t run = std::min<std::int64_t>(due, kMaxCatchUp);
  skipped_ += static_cast<std::uint64_t>(due - run);
  return static_cast<int>(run);
}

void Pacer::follow(MonoTime command_arrived_at) {
  // Distance to the wanted phase, in (-step/2, step/2].
  std::int64_t off = (next_ - (command_arrived_at + kLead)).ns % step_.ns;
  if (off > step_.ns / 2) off -= step_.ns;
  if (off <= -step_.ns / 2) off += step_.ns;
  const std::int64_t most = std::min(kMaxNudge.ns, step_.ns / 8);
  next_ = next_ - Duration{std::clamp(off / 8, -most, most)};
}

}  // namespace takt::simulation
