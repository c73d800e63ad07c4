// SPDX-License-Identifier: Apache-2.0
// The command the robot is following, as the executive believes it: instants that are its own (sensed, observed, first
// used) or claims clamped between them. All stamps are ordered: sensed <= observed <= inference <= first used.
#pragma once

#include <cstdint>

#include "executive/contract/mono_time.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::pipeline {

struct CommandInUse {
  std::uint64_t sequence = 0;  // 0: none yet
  std::uint64_t observation_id = 0;
  MonoTime sensed_at;         // t0, oldest sample it rests on
  MonoTime observed_at;       // t1, when the answered observation was published
  MonoTime infer_started_at;  // t2, claimed
  MonoTime infer_ended_at;    // t3, claimed
  MonoTime first_used_at;     // t4; while it waits for its turn: when it arrived
  std::uint64_t policy_hash = 0;
  std::uint8_t session = 0;       // of its mailbox
  std::uint8_t of_candidate = 0;  // 1: that mailbox is the candidate's
  std::uint8_t reserved[6] = {};

  // Step 0's instant.
  [[nodiscard]] MonoTime begins() const { return observed_at; }
  [[nodiscard]] Duration age(MonoTime now) const { return now - sensed_at; }
  // Telescoping: the parts add up to age(now) exactly.
  [[nodiscard]] AgeParts age_parts(MonoTime now) const {
    return {observed_at - sensed_at, infer_started_at - observed_at, infer_ended_at - infer_started_at,
            first_used_at - infer_ended_at, now - first_used_at};
  }
};

}  // namespace takt::pipeline
