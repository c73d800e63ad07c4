// What the executive itself remembers of the observations it published: id -> when its oldest sample was sensed and
// when it was published. A command's age rests on this memory, never on what a policy says.
//
// Ring of kDepth; older ids are forgotten (at 50 Hz: after 1.28 s). Ids run 1, 2, 3, ... without gaps.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "executive/contract/mono_time.hpp"

namespace takt::pipeline {

struct RememberedObservation {
  std::uint64_t id = 0;
  MonoTime oldest_sensed_at;
  MonoTime published_at;
};

class ObservationMemory {
 public:
  static constexpr std::size_t kDepth = 64;

  enum class Recall : std::uint8_t { known, never_published, not_yet_published, forgotten };

  [[nodiscard]] std::uint64_t newest_id() const { return newest_id_; }

  // Takes the next id and returns it.
  std::uint64_t remember(MonoTime oldest_sensed_at, MonoTime published_at) {
    ++newest_id_;
    ring_[newest_id_ % kDepth] = {newest_id_, oldest_sensed_at, published_at};
    return newest_id_;
  }

  [[nodiscard]] Recall recall(std::uint64_t id, RememberedObservation& found) const {
    if (id == 0) return Recall::never_published;
    if (id > newest_id_) return Recall::not_yet_published;
    found = ring_[id % kDepth];
    return found.id == id ? Recall::known : Recall::forgotten;
  }

 private:
  std::uint64_t newest_id_ = 0;
  std::array<RememberedObservation, kDepth> ring_{};
};

}  // namespace takt::pipeline
