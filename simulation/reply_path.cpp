#include "simulation/reply_path.hpp"

#include "simulation/chance.hpp"

namespace takt::plant {

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
  while (!on_the_way_.empty() && on_the_way_.front().due <= now) {
    arrived.push_back(on_the_way_.front().frame);
    on_the_way_.pop_front();
  }
}

}  // namespace takt::plant
