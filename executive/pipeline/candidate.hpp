// SPDX-License-Identifier: Apache-2.0
// The candidate: a policy that runs beside the one in charge, on the same observations. Its messages are judged in
// every tick as the policy's are, what it would do is compared with what is done, and nothing of it is played until a
// person asks for a swap.
//
//   swap  asked -> the candidate's next accepted answer takes over from the path being played, by the join rule. It
//         answers an observation no older than the newest command's. None within stop_after: nothing changed.
//   back  the same, to the robot's own policy, which ran on beside the candidate; asked for even before it
//         answers.
//
// The two change places: who was in charge is the candidate then. For `probation` of tracking by fresh commands a
// candidate in charge has half of what the contract allows: when more than half of the window's misses, refusals or
// ticks out of range are used up, or the robot leaves tracking for whatever reason, the robot's own policy is in charge
// from the same tick on, and plays if its command is fresh. Afterwards it goes back only when asked.
//
// The candidate's path is compared where it is usable: `distance` of its targets from those in use; joints whose target
// is out of range; joints whose limits it would touch, had it been played since it became usable.
//
// Pure, like the whole tick.
#pragma once

#include <span>

#include "executive/pipeline/choose.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/tick_state.hpp"

namespace takt::pipeline {

// Whose messages are taken from the mailbox of the policy in charge, and from the other one's.
ExpectedPolicy expected_in_charge(const TickState& state, const TickConfig& config);
ExpectedPolicy expected_beside(const TickState& state, const TickInput& input, const TickConfig& config);

// A person's request, and the candidate's message; either may change who is in charge. After the policy's own message.
void judge_candidate(TickState& state, const TickInput& input, const TickConfig& config, TickRecordHeader& header);
// After freshness and misses of this tick are known: back to the robot's own policy when the candidate uses up too
// much.
// Not in the tick of the swap, which was still the other one's.
void watch_probation(TickState& state, const TickConfig& config, TickRecordHeader& header);
// The robot is about to leave the mode it is in: ends a probation in tracking, and the robot's own policy is in charge.
// Whether it did.
bool roll_back(TickState& state, const TickConfig& config, TickRecordHeader& header);
// After the mode of this tick is known. Completes the record.
void settle_candidate(TickState& state, const TickConfig& config, TickRecordHeader& header);
// After the references of this tick: what the candidate would ask for now. `targets`: those in use.
void compare_candidate(TickState& state, const Choice& choice, std::span<const JointTarget> targets,
                       const TickConfig& config, TickRecord& record);

}  // namespace takt::pipeline
