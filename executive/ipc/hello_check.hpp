// SPDX-License-Identifier: Apache-2.0
// Judges what a client claims in its first message, and a policy of itself, before anything else looks at it. Pure.
#pragma once

#include <sys/types.h>

#include <string>

#include "executive/contract/policy_word.hpp"
#include "executive/contract/session.hpp"

namespace takt::ipc {

// Why this is not a hello of this contract, as one sentence; empty when it is one. `size`: bytes that arrived.
std::string fault_in(const Hello& hello, ssize_t size);

// Why this is not a policy's word, likewise.
std::string fault_in(const PolicyWord& word, ssize_t size);

// The program's name is the peer's claim and ends up in logs: printable ASCII only, always terminated.
void make_printable(Hello& hello);
void make_printable(PolicyWord& word);

}  // namespace takt::ipc
