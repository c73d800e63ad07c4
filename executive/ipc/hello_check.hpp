// SPDX-License-Identifier: Apache-2.0
// Judges the first message of a client, and a policy's word of itself, before anything else looks at them, and what
// peers say in words. Pure.
#pragma once

#include <sys/types.h>

#include <span>
#include <string>

#include "executive/contract/policy_word.hpp"
#include "executive/contract/session.hpp"

namespace takt::ipc {

// Why this is not a hello of this contract, as one sentence; empty when it is one. `size`: bytes that arrived.
std::string fault_in(const Hello& hello, ssize_t size);

// Why this is not a policy's word, likewise.
std::string fault_in(const PolicyWord& word, ssize_t size);

// A peer's words end up in logs and on terminals: printable ASCII only, always terminated.
void make_printable(std::span<char> text);

}  // namespace takt::ipc
