// SPDX-License-Identifier: Apache-2.0
// How a new chunk takes over from the path that is being played (policy.action.join). Pure.
//
// The path in use is one chunk's steps, what a join mixed into them, and a remainder that fades: path(t) = steps(t) +
// remainder(t). Both chunks speak of the same instants: step k of either is meant for k step periods after the
// observation that it answers. Where both say something, old(t) being the path of before and new(t) the chunk:
//
//   replace     new(t)
//   cross_fade  old + a (new - old), a = (t - join) / over, within 0..1
//   prefix      old until the instant that the answered observation promised (`committed_until`), then new: see below
//
// cross_fade mixes whole steps; what such a mixture misses of the path being played, because the two chunks' steps do
// not fall on the same instants, fades with it. Steps mix only where both chunks have the same fields and step period;
// else the new one is taken alone, and the whole difference fades. Nothing is joined when the path of before is not
// being played (not armed, or no usable command): the new chunk is taken as it is. Joins that need older chunks are
// the policy's host's (policy_host/chunk_mixer.hpp).
//
// prefix: every observation says which steps will be played whatever answers it (Observation::committed_count). As many
// as the delay is expected to be: the longest of the newest ten answers, none older than kDelayMemory, the first of a
// policy session left out, at most longest_delay. A delay counts what was played of it: no time before tracking began.
// An answer that comes earlier waits; one that comes later is taken at once.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/pipeline/path.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

inline constexpr Duration kDelayMemory = seconds(5);

// How late answers come. Plain value.
class DelayMemory {
 public:
  void forget() { *this = {}; }
  void note(MonoTime now, Duration delay) {
    if (!first_is_over_) {
      first_is_over_ = 1;
      return;
    }
    noted_[next_] = {now, delay};
    next_ = static_cast<std::uint32_t>((next_ + 1) % noted_.size());
  }
  // 0: nothing is remembered.
  [[nodiscard]] Duration longest(MonoTime now) const;
  // A loaded memory is believed only when note() can have left it.
  [[nodiscard]] bool is_consistent() const { return next_ < noted_.size() && first_is_over_ <= 1; }

 private:
  struct Noted {
    MonoTime at;  // unset: none
    Duration delay;
  };
  std::array<Noted, 10> noted_{};
  std::uint32_t next_ = 0;
  std::uint32_t first_is_over_ = 0;
};

struct JoinState {
  MonoTime joined_at;                             // start of the remainder; unset: there is none
  std::array<PathPoint, kMaxJoints> remainder{};  // at joined_at
  DelayMemory delays;
};

// A chunk and the instant of its first step.
struct Timed {
  const CommandChunk& chunk;
  MonoTime begins;
};

// What is left of the remainder `since` the join.
PathPoint remainder_after(const PathPoint& at_join, Duration since, const JoinRule& rule);
// The path in use of one joint, remainder included.
PathPoint path_at(const JoinState& state, const Timed& path, MonoTime now, std::size_t joint, const TickConfig& config);

// The chunk becomes the path, whatever was before.
void begin_path(JoinState& state, CommandChunk& path, const CommandChunk& next);
// Another policy's path takes over: the difference to where the references are fades (cross_fade), or is left to the
// limits. `references`: one per joint.
void join_references(JoinState& state, const Timed& path, std::span<const PathPoint> references, MonoTime now,
                     const TickConfig& config);
// The chunk takes over from the path in use, `path`, which is being played at `now`. path_begins <= next.begins.
void join_path(JoinState& state, CommandChunk& path, MonoTime path_begins, const Timed& next, MonoTime now,
               const TickConfig& config);

}  // namespace takt::pipeline
