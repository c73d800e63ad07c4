// SPDX-License-Identifier: Apache-2.0
// Which of several policy servers a robot follows. One leads until it is silent for longer than is usual for it, and
// another has something better to say; then that one leads. No server gets the lead back for having had it. Pure.
//
// Bound: from the leader's last usable word to another's first after `longest` of silence, the time to that one's next
// answer included. Thread rule: one thread.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "executive/contract/mono_time.hpp"
#include "policy_host/remote/peer.hpp"

namespace takt::policy_host::remote {

class ServerChoice {
 public:
  // How long a leader may be silent at least and at most, whatever is usual for it.
  constexpr ServerChoice(Duration shortest, Duration longest)
      : shortest_(std::min(shortest, longest)), longest_(longest) {}

  // A usable answer of `server` came; true: it is the one to follow.
  constexpr bool take(const PeerId& server, MonoTime now) {
    if (server != leader_) {
      if (leader_.is_known() && now - heard_ <= patience()) return false;
      ++changes_;
      leader_ = server;
      gaps_ = {};
      next_gap_ = 0;
    } else {
      gaps_[next_gap_++ % gaps_.size()] = now - heard_;
    }
    heard_ = now;
    return true;
  }
  // Unknown: none yet.
  [[nodiscard]] constexpr const PeerId& leader() const { return leader_; }
  // How often the lead changed, the first time included.
  [[nodiscard]] constexpr std::uint64_t changes() const { return changes_; }
  // Twice the longest of its latest pauses.
  [[nodiscard]] constexpr Duration patience() const {
    return std::clamp(*std::ranges::max_element(gaps_) * 2, shortest_, longest_);
  }

 private:
  Duration shortest_, longest_;
  PeerId leader_;
  std::uint64_t changes_ = 0;
  MonoTime heard_;
  std::array<Duration, 8> gaps_{};
  std::size_t next_gap_ = 0;
};

}  // namespace takt::policy_host::remote
