// SPDX-License-Identifier: Apache-2.0
// Ticks and frames in, one CommandTrace per policy command out, refused ones included: when each stage of it began and
// ended, by the executive's own clock and judgement (contract/tick_record.hpp, AgeParts). Pure. Thread rule: one
// thread.
#pragma once

#include <cstdint>
#include <functional>
#include <map>

#include "executive/contract/tick_record.hpp"

namespace takt::monitor {

// Instants in order; equal neighbours where a stage took no time.
struct CommandTrace {
  std::uint64_t tick = 0;  // that used it first
  std::uint64_t sequence = 0;
  std::uint64_t observation = 0;
  std::uint8_t policy_session = 0;
  Mode mode = Mode::standby;
  Arrival arrival = Arrival::accepted;  // otherwise refused: its stages are not known, all instants are the tick's
  MonoTime sensed_at;                   // oldest sample of the observation
  MonoTime observed_at{};               // observation published
  MonoTime infer_began_at{};
  MonoTime infer_ended_at{};
  MonoTime consumed_at{};   // the tick that used it woke
  MonoTime actuating_at{};  // its first frame was about to be written; consumed_at when it wrote none
  MonoTime actuated_at{};   // its last one
};

class CommandTraces {
 public:
  explicit CommandTraces(std::function<void(const CommandTrace&)> out) : out_(std::move(out)) {}
  // A tick's frames come before the tick.
  void frame(const FrameRecord& frame);
  void tick(const TickRecord& record);

 private:
  struct Sent {
    MonoTime first, last;
  };
  std::function<void(const CommandTrace&)> out_;
  std::map<std::uint64_t, Sent> sent_;  // by tick, of the newest ticks
};

}  // namespace takt::monitor
