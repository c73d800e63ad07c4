// SPDX-License-Identifier: Apache-2.0
// What came from another machine (dds/policy_types.idl), before anything is done with it. Pure.
#pragma once

#include <cstddef>
#include <string>

#include "executive/contract/mono_time.hpp"
#include "executive/contract/observation.hpp"
#include "policy_host/remote/answer_gate.hpp"
#include "policy_host/remote/peer.hpp"
#include "policy_host/remote/silence.hpp"
#include "policy_types.h"

namespace takt::policy_host::remote {

// `sender`, `heard_at`: by DDS, and by this machine's clock. The values of a command stay in the message.
Answer answer_of(const takt_remote_Command& message, const PeerId& sender);
ServerState state_of(const takt_remote_ServerStatus& message, const PeerId& sender, MonoTime heard_at);
// Its server's name, fit for a log.
std::string server_name_of(const takt_remote_Command& message);
// Whose commands its policy says that they are; empty: its own.
std::string source_of(const takt_remote_Command& message);

// Whether it can be an observation of a robot with so many joints.
bool is_sound(const takt_remote_Observation& message, std::size_t joints);
// As shown here: stamps of this machine's clock, made of the ages. Its id, and what it says of a chunk in use, are the
// caller's to fill in. Precondition: is_sound().
Observation observation_of(const takt_remote_Observation& message, MonoTime arrived_at);

}  // namespace takt::policy_host::remote
