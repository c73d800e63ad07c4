// Speculation: a policy that is slow answers for a state that is not there yet. It sends alternatives, each a chunk
// that says when it is meant to begin and in which state it assumes the joints then; the executive plays the one whose
// assumption came true, or none.
//
//   arrives   judged like every message (arrival.hpp): it answers a real observation, and its age counts from that
//   one's
//             oldest sample, as always. Then it waits. Of kMostAlternatives that wait the one of the lowest sequence
//             goes when one more comes
//   compared  in the first tick at or after the instant that it assumes, with the positions (and velocities, where it
//             says any) that this tick estimates, of every joint. Its distance is the largest difference, in
//             tolerances; it matches at 1 or less
//   taken     the nearest that matches. From there on it is a command like any other, whose step 0 is meant for the
//             assumed instant: it takes over by the join rule, and no earlier than what the newest observation promised
//             (JoinKind::prefix) is played. The others of that instant are outdone or unmatched, and gone
//   dropped   not compared: its instant was missed by more than a control period (the loop was late, or it arrived
//   late),
//             it is older than max_age there, a command of a newer observation is in use or waits; or nobody knows any
//             more whom it speaks of: reset, arming, a suspend, another policy session, a change of who is in charge
//
// What is in use goes on meanwhile and ages. Nothing here makes a command younger, and a robot whose alternatives never
// match is a robot whose policy said nothing. Only the policy in charge speculates: a candidate's alternatives are
// judged and not followed, a fallback policy's refused (wrong_shape).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/pipeline/command_in_use.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

struct TickState;

inline constexpr std::size_t kMostAlternatives = 4;
// Of one that waits, steps and assumption: all that may wait take the room of one whole chunk.
inline constexpr std::size_t kMaxAlternativeValues = kMaxChunkValues / kMostAlternatives;

// An alternative that waits. Only the used part of `values` is ever written or read.
struct Alternative {
  CommandInUse command;  // sequence 0: none
  CommandHeader header;
  std::array<float, kMaxAlternativeValues> values;
};

struct SpeculationState {
  std::uint32_t taken = 0, outdone = 0, unmatched = 0, dropped = 0;  // as in SpeculationRecord
  std::array<Alternative, kMostAlternatives> waiting;
};

constexpr std::size_t alternative_values(const CommandHeader& header) {
  return header.joint_count * (header.step_count * field_count(header.fields) +
                               field_count(static_cast<std::uint8_t>(header.assumes & kAllAssumptions)));
}

// What judge_arrival looks at: whether the header's assumption is one that this robot takes. `chunk`'s counts are
// sound.
bool is_sound_assumption(const CommandChunk& chunk, bool may_speculate, const TickConfig& config);

// An accepted alternative. Precondition: it is sound.
void keep_alternative(SpeculationState& state, const CommandChunk& chunk, const CommandInUse& command);
// All that wait are dropped.
void drop_alternatives(SpeculationState& state);
// The alternatives whose instant has come, compared with the joints' estimates in `record`; the one that is taken waits
// for its turn in the state. Fills `record`'s share.
void compare_alternatives(TickState& state, MonoTime now, const TickConfig& config, TickRecord& record);

}  // namespace takt::pipeline
