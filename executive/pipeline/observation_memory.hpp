// SPDX-License-Identifier: Apache-2.0
// What the executive itself remembers of the observations it published: id -> when its oldest sample was sensed and
// when it was published. A command's age rests on this memory, never on what a policy says.
//
// Ring of the newest `depth` observations, so many that none is forgotten before it is max_age old
// (observations_to_remember). Ids run 1, 2, 3, ... without gaps. Range: depth 1..kMaxRememberedObservations, the same
// at every call.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "executive/contract/mono_time.hpp"
#include "executive/contract/observation.hpp"

namespace takt::pipeline {

struct RememberedObservation {
  MonoTime oldest_sensed_at;
  MonoTime published_at;
  MonoTime
      committed_until{};  // until then the path of before is played, whatever answers this; unset: nothing promised
};

class ObservationMemory {
 public:
  enum class Recall : std::uint8_t { known, never_published, not_yet_published, forgotten };

  // Takes the next id and returns it.
  std::uint64_t remember(const RememberedObservation& observation, std::uint32_t depth) {
    ++newest_id_;
    ring_[newest_id_ % depth] = observation;
    return newest_id_;
  }

  [[nodiscard]] Recall recall(std::uint64_t id, std::uint32_t depth, RememberedObservation& found) const {
    if (id == 0) return Recall::never_published;
    if (id > newest_id_) return Recall::not_yet_published;
    if (id <= forgotten_id_ || newest_id_ - id >= depth) return Recall::forgotten;
    found = ring_[id % depth];
    return Recall::known;
  }

  // The id that was published last; 0: none yet.
  [[nodiscard]] std::uint64_t newest() const { return newest_id_; }

  // From now on `to` are remembered, not `from` <= `to`. What was forgotten stays so.
  void deepen(std::uint32_t from, std::uint32_t to) {
    const auto before = ring_;
    if (newest_id_ > from) forgotten_id_ = std::max(forgotten_id_, newest_id_ - from);
    for (std::uint64_t id = forgotten_id_ + 1; id <= newest_id_; ++id) ring_[id % to] = before[id % from];
  }

  // Everything published so far. Ids go on.
  void forget() { forgotten_id_ = newest_id_; }

  // What keyframes carry: two ids, then the part of the ring that `depth` uses.
  static constexpr std::size_t saved_bytes(std::uint32_t depth) {
    return 16 + sizeof(RememberedObservation) * std::size_t{depth};
  }
  [[nodiscard]] bool is_consistent() const { return forgotten_id_ <= newest_id_; }

 private:
  std::uint64_t newest_id_ = 0;
  std::uint64_t forgotten_id_ = 0;  // this one and all before it
  std::array<RememberedObservation, kMaxRememberedObservations> ring_{};
};
static_assert(sizeof(ObservationMemory) == ObservationMemory::saved_bytes(kMaxRememberedObservations));

}  // namespace takt::pipeline
