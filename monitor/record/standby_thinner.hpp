// SPDX-License-Identifier: Apache-2.0
// A robot that stands by for days needs no 1 kHz record. Between two keyframes of quiet standby this keeps the first of
// every kOneIn ticks, whole and in a row, with their frames, messages and inputs, so that replay from the keyframe is
// exact for every tick that is kept; the rest is declared as a loss of the reason kStoodBy.
//
// Quiet: in standby, no operator asks for anything, the active causes stay what they are, for five seconds. What came
// since the last keyframe is held back until it is known to be quiet; anything else lets it all go on, at once and in
// order. Memory is bounded by kMostHeld ticks. Thread rule: one thread.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <variant>

#include "monitor/record/record_stream.hpp"

namespace takt::monitor {

class StandbyThinner {
 public:
  static constexpr std::uint64_t kOneIn = 20;
  static constexpr std::uint64_t kMostHeld = 1024;  // ticks

  // What goes on goes on into `kept`, which outlives this. Commands come before their tick, frames whenever they like.
  explicit StandbyThinner(const RecordSink& kept) : kept_(kept) {}
  void command(const RecordedCommand& command);
  void tick(const TickRecord& record);
  void keyframe(const RecordedKeyframe& keyframe);
  void frame(const FrameRecord& frame);
  void policy_input(const RecordedPolicyInput& input);
  // The record ends: what was held back goes on.
  void finish() { let_go(); }
  // What is said now is held back, and most likely left out.
  [[nodiscard]] bool holds_back() const { return thins_ && ticks_ >= window_; }

 private:
  struct HeldTick {
    Bytes bytes;  // used_bytes() of it
  };
  using Held = std::variant<RecordedCommand, HeldTick, RecordedPolicyInput>;
  bool is_quiet(const TickRecord& record);
  void let_go();
  void leave_out(std::uint64_t through_tick);

  const RecordSink& kept_;
  bool thins_ = false;
  std::uint64_t keyframe_tick_ = 0;       // of the newest keyframe
  std::uint64_t ticks_ = 0, window_ = 0;  // since it; of them kept
  std::uint64_t last_kept_ = 0;
  std::uint64_t causes_ = 0;
  MonoTime loud_at_, newest_at_;  // of the newest tick that was not quiet; of the newest
  std::deque<Held> held_;
  std::uint64_t held_ticks_ = 0;
  std::deque<FrameRecord> frames_;
};

}  // namespace takt::monitor
