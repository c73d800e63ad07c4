// SPDX-License-Identifier: Apache-2.0
// Judges the first message of a client before anything else looks at it. Pure.
#pragma once

#include <sys/types.h>

#include <string>

#include "executive/contract/session.hpp"

namespace takt::ipc {

// Why this is not a hello of this contract, as one sentence; empty when it is one. `size`: bytes that arrived.
std::string fault_in(const Hello& hello, ssize_t size);

// The program's name is the peer's claim and ends up in logs: printable ASCII only, always terminated.
void make_printable(Hello& hello);

}  // namespace takt::ipc
