// SPDX-License-Identifier: Apache-2.0
#include "simulation/reply_path.hpp"

#include <algorithm>

#include "simulation/chance.hpp"

namespace takt::simulation {

bool ReplyPath::is_lost() {
  return faults_.silent || happens(faults_.drop, random_);
}

void ReplyPath::take(const Frames& said, MonoTime now) {
  for (const drivers::CanFrame& frame : said) {
    if (is_lost()) continue;
    for (int copy = 0; copy < (faults_.repeat ? 2 : 1); ++copy)
      if (on_the_way_.size() < kMaxOnTheWay) on_the_way_.push_back({frame, now + faults_.delay});
  }
}

void ReplyPath::deliver(MonoTime now, Frames& arrived) {
  const auto rest = std::ranges::find_if(on_the_way_, [now](const OnTheWay& one) { return one.due > now; });
  for (auto one = on_the_way_.begin(); one != rest; ++one) arrived.push_back(one->frame);
  on_the_way_.erase(on_the_way_.begin(), rest);
}

}  // namespace takt::simulation
